"""Check what a page names: files, commands and their options, make targets, names in Python."""

import logging
import re
import shlex
from pathlib import Path
from pkgutil import resolve_name

import click

from accelstudy.commands.main import main

ROOT = Path(__file__).parents[2]
CODE = re.compile(
    r"^```.*?^```|(?:^ {4}.*\n)+|(?<!`)``(?!`).+?``|`[^`]+`", re.MULTILINE | re.DOTALL
)
FILE = re.compile(r"`((?:accelstudy|benchmarks|config|docs|examples|profiles|workflow)/[\w/.-]*)`")
PART = re.compile(r"`([\w/]+\.py)`")  # of a walk through a room
COMMAND = re.compile(r"(?:^ *|`)accelstudy ([^`\n]*(?:\\\n[^`\n]*)*)", re.MULTILINE)
DOTTED = re.compile(r"\b(accelstudy\.[a-z_]\w*(?:\.\w+)*)(?: import (\([^)]*|[\w, ]+))?")
TARGET = re.compile(r"(?:^ *|`)make ([a-z][a-z-]*)", re.MULTILINE)

log = logging.getLogger("mkdocs.hooks.named")


def on_page_markdown(markdown, page, **_):
    """Warn of what there is not; a strict build then fails."""
    code = "\n".join(found[0] for found in CODE.finditer(markdown))
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    missing = [name for name in FILE.findall(code) if not (ROOT / name).exists()]
    missing += [name for name in PART.findall(code) if not _is_file(name)]
    missing += [f"make {t}" for t in TARGET.findall(code) if f"\n{t}:" not in makefile]
    missing += re.findall(r"--8 .*", code)  # a formatter took a snippet for Python
    missing += filter(None, map(_unknown, COMMAND.findall(code)))
    missing += [name for found in DOTTED.findall(code) for name in _names(*found) if _absent(name)]
    for name in dict.fromkeys(missing):
        log.warning("%s names %s, which there is not", page.file.src_uri, name)


def _is_file(name):
    return (ROOT / name).exists() or any(ROOT.glob(f"accelstudy/**/{name}"))


def _names(name, imported):
    return [f"{name}.{each}" for each in re.findall(r"\w+", imported)] or [name]


def _absent(name):
    try:
        resolve_name(name)
    except (ImportError, AttributeError):
        return True
    return False


def _unknown(text):
    """What is no command, or no option of it; None where all is."""
    try:
        words = shlex.split(text.replace("\\\n", " "))
    except ValueError:  # a quote that is not closed: prose
        return None
    name = next((word for word in words if not word.startswith("-")), "")
    command = main.commands.get(name)
    if command is None:
        return f"accelstudy {name}" if re.fullmatch(r"[a-z-]+", name) else None
    try:
        parser = command.make_parser(click.Context(command))
        parser.parse_args(words[words.index(name) + 1 :])
    except click.NoSuchOption as error:
        return f"accelstudy {name} {error.option_name}"
    except click.UsageError:  # a page may name an option without its value
        return None

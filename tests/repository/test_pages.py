"""What README and pages name exists: files, make targets, commands, options, names in Python."""

import re
import shlex
from pkgutil import resolve_name

import click
import pytest
from places import ROOT

from accelstudy.commands.main import main

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
CODE = re.compile(
    r"^```.*?^```|(?:^ {4}.*\n)+|(?<!`)``(?!`).+?``|`[^`]+`", re.MULTILINE | re.DOTALL
)
FILE = re.compile(r"`((?:accelstudy|benchmarks|config|docs|examples|profiles|workflow)/[\w/.-]*)`")
MODULE = re.compile(r"`([\w/]+\.py)`")  # of a walk through a room
COMMAND = re.compile(r"(?:^ *|`)accelstudy ([^`\n]*(?:\\\n[^`\n]*)*)", re.MULTILINE)
DOTTED = re.compile(r"\b(accelstudy\.[a-z_]\w*(?:\.\w+)*)(?: import (\([^)]*|[\w, ]+))?")
TARGET = re.compile(r"(?:^ *|`)make ([a-z][a-z-]*)", re.MULTILINE)
MAKEFILE = (ROOT / "Makefile").read_text("utf-8")


def missing(text):
    """What a text names as code, and there is not."""
    code = "\n".join(found[0] for found in CODE.finditer(text))
    names = [name for found in DOTTED.findall(code) for name in python_names(*found)]
    return [
        *(path for path in FILE.findall(code) if not (ROOT / path).exists()),
        *(path for path in MODULE.findall(code) if not is_module(path)),
        *(f"make {name}" for name in TARGET.findall(code) if f"\n{name}:" not in MAKEFILE),
        *re.findall(r"--8 .*", code),  # a formatter took a snippet for Python
        *filter(None, map(unknown_words, COMMAND.findall(code))),
        *(name for name in names if not can_import(name)),
    ]


def is_module(path):
    return (ROOT / path).exists() or any(ROOT.glob(f"accelstudy/**/{path}"))


def python_names(name, imported):
    return [f"{name}.{each}" for each in re.findall(r"\w+", imported)] or [name]


def can_import(name):
    try:
        resolve_name(name)
    except (ImportError, AttributeError):
        return False
    return True


def unknown_words(text):
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


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_a_page_names_exists(page):
    assert missing(page.read_text("utf-8")) == []


@pytest.mark.parametrize("text", [
    "`config/sweeps/none.yaml`", "`make nothing`", "`accelstudy calibrat log`",
    "    accelstudy calibrate campaign --modle bias\n", "`accelstudy.calibrat`",
    "`from accelstudy.schemes import get_scheme, no_scheme`", "`nothing.py`",
])  # fmt: skip
def test_what_there_is_not_is_found_in_a_page(text):
    assert len(missing(text)) == 1

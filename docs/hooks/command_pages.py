"""The page of all commands, from what their `--help` says."""

import re

import click
from markdown_text import page, plain, table

from accelstudy.commands.main import SECTIONS, main


def commands():
    """All commands, in the order of `accelstudy --help`."""
    top = click.Context(main, info_name="accelstudy")
    lists = []
    for title, its in SECTIONS.items():
        rows = [(f"[`{c.name}`](#{c.name})", c.get_short_help_str(200)) for c in its]
        lists += [f"**{title}**", table(("command", "what it does"), rows)]
    return page(*lists, *(_command(command, top) for its in SECTIONS.values() for command in its))


def own_options():
    """What accelstudy does, and its own options."""
    options = _options(main, click.Context(main, info_name="accelstudy"))
    return page(_text(main.help), "Options of `accelstudy` itself:", _table(options))


def _command(command, top):
    context = click.Context(command, info_name=command.name, parent=top)
    options = _options(command, context)
    said = [(f"`{name}`", text) for name, text in command.meanings().items()]
    own = dict(getattr(command, "sections", {}))
    named = {title: [options.pop(name) for name in names] for title, names in own.items()}
    usage = command.get_usage(context).removeprefix("Usage: ")
    tables = [
        part for title, rows in named.items() for part in (f"**{title}**", table(HEADS, rows))
    ]
    if named:
        tables.append("**Other options**")
    example = (command.epilog or "").partition("Example:\n")[2]
    return page(
        f"## {command.name}",
        f"```text\n{' '.join(usage.split())}\n```",
        _text(command.help),
        *([table(("argument", "meaning"), said)] if said else []),
        *tables,
        _table(options),
        f"Example:\n\n```sh\n{_dedent(example)}\n```",
    )


HEADS = ("option", "meaning")


def _options(command, context):
    """Rows of the options of a command by their names, without `--help`."""
    found = {}
    for option in command.get_params(context):
        record = option.get_help_record(context)
        if record and option.name != "help":
            names, meaning = record
            found[option.name] = (f"`{names}`", _text(meaning))
    return found


def _table(options):
    return table(HEADS, options.values()) if options else ""


def _text(text):
    """Help as Markdown; its paragraphs stay."""
    paragraphs = re.split(r"\n\s*\n", (text or "").replace("\b\n", "").strip())
    return "\n\n".join(plain(" ".join(each.split())) for each in paragraphs)


def _dedent(example):
    return "\n".join(line.strip() for line in example.strip().splitlines())

"""What the commands and the reports say of themselves: helps, and the terms that are explained."""

import click
from markdown_text import page, table

from accelstudy import pages
from accelstudy.commands.main import SECTIONS, main

WIDTH = 100
"""Of the help, letters."""


def commands():
    """Help of accelstudy, and of all commands in its order."""
    top = click.Context(main, info_name="accelstudy", terminal_width=WIDTH)
    parts = [_help(main, top)]
    for command in (command for section in SECTIONS.values() for command in section):
        context = click.Context(command, info_name=command.name, parent=top, terminal_width=WIDTH)
        parts += [f"## {command.name}", _help(command, context)]
    return page(*parts)


def _help(command, context):
    return f"```text\n{command.get_help(context)}\n```"


def terms():
    """The terms that reports explain."""
    return table(("", ""), [(f"**{term}**", meaning) for term, meaning in pages.terms().items()])

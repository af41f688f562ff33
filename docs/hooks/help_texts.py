"""What the commands and the reports say of themselves: helps, and the terms that are explained."""

import click
from markdown_text import page, table

from accelstudy import pages
from accelstudy.commands.main import main


def commands():
    """Help of accelstudy, and of all commands in its order."""
    top = click.Context(main, info_name="accelstudy", terminal_width=100)
    each = (click.Context(command, top, name) for name, command in main.commands.items())
    return page(_help(top), *(page(f"## {one.info_name}", _help(one)) for one in each))


def _help(context):
    return f"```text\n{context.get_help()}\n```"


def terms():
    """The terms that reports explain."""
    return table(("", ""), [(f"**{term}**", meaning) for term, meaning in pages.terms().items()])

"""How commands print what is no result with a page: tables, texts and mappings."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from accelstudy.basics.progress import say, show

if TYPE_CHECKING:
    import pandas as pd

DIGITS = 4
"""Significant digits of a number in a table."""


def number(value: Any) -> str:
    """Write a number as in a table; anything else as it is."""
    return f"{value:.{DIGITS}g}" if isinstance(value, float) else str(value)


def tell_value(value: Any) -> None:
    """Print what a verb returns; a table with its title and its legend, unless it is quiet."""
    if isinstance(value, str):
        click.echo(value, nl=not value.endswith("\n"))
    elif isinstance(value, dict):
        click.echo(json.dumps(value, indent=2, ensure_ascii=False))
    elif value is not None:
        _tell_table(value)


def _tell_table(table: pd.DataFrame) -> None:
    """Print a table, a line a row; a catalogue, whose texts are long, a line a cell.

    Positions are printed as CSV, so that other programs can read them.
    """
    if table.index.name == "position":  # of a scheme
        show(f"# {table.attrs['title']}")
        click.echo(table.to_csv(float_format="%.6f"), nl=False)
        return
    if title := table.attrs.get("title"):
        say(f"{title}\n")
    if table.index.name == "name":
        for name, (first, *others) in zip(table.index, table.to_dict("split")["data"], strict=True):
            click.echo(f"{name}: {first}")
            for column, cell in zip(table.columns[1:], others, strict=True):
                if cell == cell and cell not in (None, ""):
                    click.echo(f"    {column}: {number(cell)}")
    else:
        shown = table.reset_index() if table.index.name else table
        texts = shown.select_dtypes(exclude=["number", "bool"]).astype(str)
        forms: dict[str, Callable[..., str]] = {
            str(name): f"{{:<{max(map(len, [name, *texts[name]]))}}}".format for name in texts
        }
        text = shown.to_string(
            index=False,
            justify="left",
            formatters=forms,
            float_format=number,
            na_rep="–",
        )
        click.echo("\n".join(map(str.rstrip, text.splitlines())))
    if legend := table.attrs.get("legend"):
        say(f"\n{legend}")

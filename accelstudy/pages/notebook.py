"""What a notebook shows of a result."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


MAX_ROWS = 12
"""Rows up to which all are shown; of more, the first and the last."""


def notebook_html(title: str, sentence: str, table: pd.DataFrame) -> str:
    """Show a result in a notebook: what it is, a sentence on it, and its table."""
    if table.index.names != [None]:
        table = table.reset_index()
    rows = table.to_html(
        border=0, index=False, float_format="{:.4g}".format, na_rep="–", max_rows=MAX_ROWS
    )
    return f"<p><b>{escape(title)}</b>: {escape(sentence)}</p>{rows}"

"""Tables of what no schema describes: columns of a campaign, rules of a diagnosis."""

import griffe
from markdown_text import code, plain, table

from accelstudy.campaign.columns import ANY, COLUMNS
from accelstudy.diagnosis.rules import RULES


def positions():
    """Columns of the positions of a campaign."""
    rows = [
        (
            ", ".join(map(code, column.keys)),
            "whole number" if column.whole else "number",
            "*unit*" if column.unit == "unit" else column.unit,
            "" if column.within is ANY else f"{column.within.least:g} … {column.within.most:g}",
            "*required*" if column.needed else "",
            column.meaning,
        )
        for column in COLUMNS.values()
    ]
    return table(("columns", "type", "unit", "range", "", "meaning"), rows)


def rules(kind):
    """Rules by which a diagnosis decides, with their reasons: its priors, or all others."""
    each = griffe.load("accelstudy.diagnosis.rules")["Rules"].attributes.items()
    rows = (
        (code(name), f"{getattr(RULES, name):g}", plain(one.docstring.value))
        for name, one in each
        if name.startswith("prior_") == (kind == "priors")
    )
    return table(("rule", "value", "what it is"), rows)

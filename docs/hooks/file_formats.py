"""Tables of what may stand in files."""

from pathlib import Path

import griffe
import yaml
from markdown_text import code, plain, table
from schemas import blocks

from accelstudy.campaign.header import ANY, COLUMNS, HEADER, Header
from accelstudy.campaign.of_type import TYPE_FILE, TypeFile
from accelstudy.diagnosis.rules import RULES

REFERENCE = Path(__file__).parent.parent / "reference"


def positions():
    """Columns of the positions of a campaign."""
    rows = []
    for column in COLUMNS.values():
        within = column.within
        rows.append(
            (
                ", ".join(map(code, column.names)),
                "whole number" if column.whole else "number",
                "*unit*" if column.unit == "unit" else column.unit,
                "" if within is ANY else f"{within.least:g} … {within.most:g}",
                "*required*" if column.needed else "",
                column.meaning,
            )
        )
    return table(("columns", "type", "unit", "range", "", "meaning"), rows)


def header():
    """Keys of the header of a campaign."""
    return blocks(Header.model_json_schema(), f"Campaign: `{HEADER}`", "header: ")


def document(title, name):
    """Keys of a JSON file that has a schema of its own."""
    schema = yaml.safe_load((REFERENCE / f"{name}.schema.yaml").read_text("utf-8"))
    return blocks(schema, f"{title}: `{name}.json`", f"{name}: ")


def of_type():
    """Keys of the file of a type."""
    return blocks(TypeFile.model_json_schema(), f"Lot: `{TYPE_FILE}`", "type: ")


def rules(priors):
    """Rules by which a diagnosis decides, with their reasons: its prior weights, or all others."""
    each = griffe.load("accelstudy.diagnosis.rules")["Rules"].attributes.items()
    rows = (
        (code(name), f"{getattr(RULES, name):g}", plain(one.docstring.value))
        for name, one in each
        if name.startswith("prior_") == priors
    )
    return table(("rule", "value", "what it is"), rows)

"""Tables of the files: campaigns, calibrations, diagnoses, and the tables of studies."""

from pathlib import Path

import yaml
from markdown_text import code, page, table
from schemas import blocks

from accelstudy.campaign.header import ANY, COLUMNS, HEADER, Header

HERE = Path(__file__).parent


def study_tables():
    """Tables of a study and their columns: {table: (row, {column: (unit, meaning)})}."""
    return {
        name: (each["row"], {**each.get("columns", {}), **each.get("more", {})})
        for name, each in _read("tables.yaml").items()
    }


def calibration_files():
    """Files of a calibration and of a batch: {file: (what it is, {key: (unit, meaning)})}."""
    return {name: (each["about"], each["columns"]) for name, each in _read("files.yaml").items()}


def _read(name):
    return yaml.safe_load((HERE / name).read_text(encoding="utf-8"))


def _columns(heads, columns):
    return table(heads, [(code(name), *rest) for name, rest in columns.items()])


def tables():
    """All tables of a study."""
    parts = []
    for name, (row, columns) in study_tables().items():
        file = "estimates/*.parquet" if name == "estimates" else f"{name}.parquet"
        parts += [
            f"## `{file}`",
            f"A row per {row}.",
            _columns(("column", "unit", "meaning"), columns),
        ]
    return page(*parts)


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


def calibrations():
    """Files of a calibration and of a batch."""
    parts = []
    for name, (about, columns) in calibration_files().items():
        kind = {".json": "key", ".parquet": "column"}.get(Path(name).suffix, "name")
        whose = "Batch" if about.startswith("A batch") else "Calibration"
        heads = (kind, "unit", "meaning")
        parts += [f"## {whose}: `{name}`", about, _columns(heads, columns)]
    return page(*parts)


def header():
    """Keys of the header of a campaign."""
    return blocks(Header.model_json_schema(), f"Campaign: `{HEADER}`", "header: ")


def diagnosis():
    """Keys of a diagnosis."""
    schema = yaml.safe_load((HERE.parent / "reference/diagnosis.schema.yaml").read_text("utf-8"))
    return blocks(schema, "Diagnosis: `diagnosis.json`", "diagnosis: ")

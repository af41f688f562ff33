"""Pages of the files: campaigns, calibrations, diagnoses, and the tables of studies."""

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
    """The page of the tables of a study."""
    parts = []
    for name, (row, columns) in study_tables().items():
        file = "estimates/*.parquet" if name == "estimates" else f"{name}.parquet"
        parts += [
            f"## `{file}`",
            f"A row per {row}.",
            _columns(("column", "unit", "meaning"), columns),
        ]
    return page(
        "# Tables of a study",
        "A study writes these tables to `results/<study>/`, as Parquet. Each file says where it "
        "comes from: hash of the configuration, seed, version, commit and the libraries' versions "
        "(`accelstudy.files.tables.read_origin`). Where the unit is *unit*, the column of that "
        "name has it. What is not known is null.",
        *parts,
    )


def formats():
    """The page of all other files."""
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
    calibration = []
    for name, (about, columns) in calibration_files().items():
        kind = {".json": "key", ".parquet": "column"}.get(Path(name).suffix, "name")
        whose = "Batch" if about.startswith("A batch") else "Calibration"
        heads = (kind, "unit", "meaning")
        calibration += [f"## {whose}: `{name}`", about, _columns(heads, columns)]
    schema = HERE.parent / "reference" / "diagnosis.schema.yaml"
    return page(
        "# File formats",
        "What the guides say of the files in words: [campaigns](../guides/campaign-format.md), "
        "[diagnosis](../guides/diagnosis.md#files). The tables of a study are "
        "[a page of their own](tables.md).",
        blocks(Header.model_json_schema(), f"Campaign: `{HEADER}`", "header: "),
        "## Campaign: `positions.csv` or `positions.parquet`",
        "Columns that belong together are all there or all absent. *unit* is the unit of the "
        "header.",
        table(("columns", "type", "unit", "range", "", "meaning"), rows),
        *calibration,
        blocks(
            yaml.safe_load(schema.read_text(encoding="utf-8")),
            "Diagnosis: `diagnosis.json`",
            "diagnosis: ",
        ),
        "The JSON Schema itself, with what each verdict requires: "
        "[diagnosis.schema.yaml](diagnosis.schema.yaml).",
    )

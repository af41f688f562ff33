"""The overview of a batch: two tables and one page with all campaigns."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from accelstudy.basics import suggestions
from accelstudy.basics.levels import (
    ACCEPTED,
    BLIND,
    IMPLAUSIBLE,
    REFUTATION_LEVEL,
    REJECTED,
    UNCHECKED,
)
from accelstudy.basics.units import MGON
from accelstudy.files.outputs import BATCH_JOB, whole_file
from accelstudy.files.tables import write_table
from accelstudy.pages import render

_CAMPAIGNS = {
    "campaign": ("string", "name"),
    "status": ("string", "status"),
    "error": ("string", "error"),
    "kind": ("string", "kind"),
    "source": ("string", "source"),
    "sensor": ("string", "sensor"),
    "model": ("string", "model"),
    "approach": ("string", "approach"),
    "gravity_mps2": ("float64", "gravity_mps2"),
    "n_positions": ("Int64", "n_positions"),
    "redundancy": ("Int64", "redundancy"),
    "sigma_priori_mps2": ("float64", "sigma_position_priori_mps2"),
    "sigma_posteriori_mps2": ("float64", "sigma_position_posteriori_mps2"),
    "sigma_source": ("string", "sigma_source"),
    "sigma0": ("float64", ""),
    "p_value": ("float64", "quality.global_test.p_value"),
    "accepted": ("boolean", "quality.global_test.accepted"),
    "state": ("string", "quality.state"),
    "suspects": ("string", "suspects"),
    "rms_norm_residual_mps2": ("float64", "rms_norm_residual_mps2"),
    "held_out_mps2": ("float64", "quality.held_out.rms_mps2"),
    "held_out_roll_rad": ("float64", "quality.held_out.rms_roll_mgon"),
    "held_out_pitch_rad": ("float64", "quality.held_out.rms_pitch_mgon"),
    "tilt_roll_rad": ("float64", "quality.tilt_rms_mgon.roll"),
    "tilt_pitch_rad": ("float64", "quality.tilt_rms_mgon.pitch"),
    "verdict": ("string", "quality.verdict"),
    "warnings": ("string", "warnings"),
}
"""Columns of the table of campaigns, their types, and their keys in status.json and
calibration.json."""
CAMPAIGN_COLUMNS = {column: kind for column, (kind, _) in _CAMPAIGNS.items()}
"""Columns of the table of campaigns and their types (docs/guides/campaign-format.md)."""

PARAMETER_COLUMNS = {
    "campaign": "string",
    "parameter": "string",
    "value": "float64",
    "sigma": "float64",
    "ci95": "float64",
    "sigma_priori": "float64",
    "sigma_posteriori": "float64",
    "unit": "string",
}
"""Columns of the table of parameters and their types; numbers are in SI."""


def summarise_campaigns(
    batch: str,
    folders: Iterable[str | Path],
    campaigns: str | Path,
    parameters: str | Path,
    page: str | Path,
    provenance: Mapping[str, Any],
) -> pd.DataFrame:
    """Write the tables (Parquet) and the page (HTML) of a batch.

    Parameters
    ----------
    batch : str, its name
    folders : paths, written by `run_task`
    campaigns, parameters, page : paths to write
    provenance : mapping, see `accelstudy.files.tables.origin`

    Returns
    -------
    DataFrame
        The table of campaigns.
    """
    documents, values = [], []
    paths = [Path(folder) for folder in folders]
    for folder in paths:
        document = _read(folder / BATCH_JOB.marker)
        if document["status"] == "ok":
            content = _read(folder / "calibration.json")
            values += [{"campaign": document["name"], "parameter": entry["name"], **entry}
                       for entry in content["parameters"]]  # fmt: skip
            suspects = (str(suspect["position"]) for suspect in content["quality"]["suspects"])
            document = {
                **content,
                **document,
                "approach": content["approach"],  # that of the configuration may leave it open
                "suspects": ", ".join(suspects),
                "warnings": "\n".join(content["warnings"]),
            }
        documents.append(document)
    flat = pd.json_normalize(documents)
    table = pd.DataFrame({column: flat.get(key) for column, (_, key) in _CAMPAIGNS.items()})
    table = table.astype(CAMPAIGN_COLUMNS)
    table["sigma0"] = table["sigma_posteriori_mps2"] / table["sigma_priori_mps2"]
    angles = [column for column in CAMPAIGN_COLUMNS if column.endswith("_rad")]
    table[angles] *= MGON
    write_table(campaigns, table, provenance)
    long = pd.DataFrame(values, columns=list(PARAMETER_COLUMNS)).astype(PARAMETER_COLUMNS)
    write_table(parameters, long, provenance)
    records = table.astype(object).where(table.notna(), None).to_dict("records")
    rows = [{**row, "folder": folder} for row, folder in zip(records, paths, strict=True)]
    with whole_file(page) as path:
        path.write_text(_page(batch, rows, Path(page).parent), encoding="utf-8")
    return table


def counts(table: pd.DataFrame) -> str:
    """Number of campaigns that were calibrated; implausible calibrations are counted apart."""
    implausible = int((table["state"] == IMPLAUSIBLE).sum())
    calibrated = int((table["status"] == "ok").sum()) - implausible
    doubt = f", {implausible} implausible" if implausible else ""
    return f"{calibrated} of {len(table)} campaigns calibrated{doubt}"


def _read(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8"))


def _page(batch: str, rows: list[dict[Any, Any]], start: Path) -> str:
    """Page (HTML, self-contained apart from its links, which begin at `start`), failures first."""
    for row in rows:
        for key, place in (("report", "report.html"), ("holds", "campaign/segmentation.png")):
            path = Path(row["folder"], place)
            row[key] = path.relative_to(start).as_posix() if path.exists() else None
    return render(
        "campaign/batch/overview.html.j2",
        batch=batch,
        failed=[row for row in rows if row["status"] != "ok"],
        implausible=[row for row in rows if row["state"] == IMPLAUSIBLE],
        calibrated=[row for row in rows if row["status"] == "ok" and row["state"] != IMPLAUSIBLE],
        level=REFUTATION_LEVEL,
        blind=BLIND,
        next_steps=_next_steps(rows),
    )


def _next_steps(rows: list[dict[Any, Any]]) -> list[tuple[str, str]]:
    """Commands for the first good and for the first doubtful campaign, each with its purpose."""
    steps = []
    for row in [row for row in rows if row["state"] in (ACCEPTED, UNCHECKED)][:1]:
        command = suggestions.apply(Path(row["folder"], suggestions.HERE))
        steps.append(("Level a log, for example", command))
    for row in [row for row in rows if row["state"] in (REJECTED, IMPLAUSIBLE)][:1]:
        is_folder = row["kind"] == "campaign"
        measured = row["source"] if is_folder else Path(row["folder"], "campaign")
        command = suggestions.diagnose(measured, row["model"], row["approach"])
        steps.append(("Find what is wrong or missing, for example", command))
    return steps

"""The overview of a batch: two tables and one page with all campaigns."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from accelstudy.basics import suggested
from accelstudy.basics.levels import (
    ACCEPTED,
    BLIND,
    IMPLAUSIBLE,
    REFUTED,
    REJECTED,
    UNCHECKED,
)
from accelstudy.basics.units import MGON
from accelstudy.files.outputs import BATCH_JOB, whole_file
from accelstudy.files.tables import write_table
from accelstudy.pages import render

CAMPAIGN_COLUMNS = {
    "campaign": "string",
    "status": "string",
    "error": "string",
    "kind": "string",
    "source": "string",
    "sensor": "string",
    "model": "string",
    "approach": "string",
    "gravity_mps2": "float64",
    "n_positions": "Int64",
    "redundancy": "Int64",
    "sigma_priori_mps2": "float64",
    "sigma_posteriori_mps2": "float64",
    "sigma_source": "string",
    "sigma0": "float64",
    "p_value": "float64",
    "accepted": "boolean",
    "state": "string",
    "suspects": "string",
    "rms_norm_residual_mps2": "float64",
    "held_out_mps2": "float64",
    "held_out_roll_rad": "float64",
    "held_out_pitch_rad": "float64",
    "tilt_roll_rad": "float64",
    "tilt_pitch_rad": "float64",
    "verdict": "string",
    "warnings": "string",
}
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
    paths = [Path(folder) for folder in folders]
    rows, values = [], []
    for folder in paths:
        status = _read(folder / BATCH_JOB.marker)
        content = _read(folder / "calibration.json") if status["status"] == "ok" else None
        rows.append(_row(status, content))
        for entry in content["parameters"] if content else ():
            values.append({"campaign": status["name"], "parameter": entry["name"], **entry})
    table = pd.DataFrame(rows, columns=list(CAMPAIGN_COLUMNS)).astype(CAMPAIGN_COLUMNS)
    write_table(campaigns, table, provenance)
    long = pd.DataFrame(values, columns=list(PARAMETER_COLUMNS)).astype(PARAMETER_COLUMNS)
    write_table(parameters, long, provenance)
    links = [_links(folder, Path(page).parent) for folder in paths]
    with whole_file(page) as path:
        path.write_text(_page(batch, table, links), encoding="utf-8")
    return table


def counts(table: pd.DataFrame) -> str:
    """Number of campaigns that were calibrated; implausible calibrations are counted apart."""
    implausible = int((table["state"] == IMPLAUSIBLE).sum())
    calibrated = int((table["status"] == "ok").sum()) - implausible
    doubt = f", {implausible} implausible" if implausible else ""
    return f"{calibrated} of {len(table)} campaigns calibrated{doubt}"


def _read(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8"))


def _row(status: Mapping[str, Any], content: Mapping[str, Any] | None) -> dict[str, Any]:
    row = {**status, "campaign": status["name"]}
    if content is None:
        return row
    quality = content["quality"]
    test, held, tilt = (
        quality["global_test"] or {},
        quality["held_out"] or {},
        quality["tilt_rms_mgon"],
    )
    priori, posteriori = (content[f"sigma_position_{key}_mps2"] for key in ("priori", "posteriori"))
    both = priori is not None and posteriori is not None
    suspects = [str(suspect["position"]) for suspect in quality["suspects"]]
    return {
        **row,
        "approach": content["approach"],
        **{key: content[key] for key in CAMPAIGN_COLUMNS if key in content and key not in row},
        "sigma_priori_mps2": priori,
        "sigma_posteriori_mps2": posteriori,
        "sigma0": posteriori / priori if both else None,
        "p_value": test.get("p_value"),
        "accepted": test.get("accepted"),
        "state": quality["state"],
        "suspects": ", ".join(suspects),
        "held_out_mps2": held.get("rms_mps2"),
        "held_out_roll_rad": _rad(held.get("rms_roll_mgon")),
        "held_out_pitch_rad": _rad(held.get("rms_pitch_mgon")),
        "tilt_roll_rad": _rad(tilt["roll"]),
        "tilt_pitch_rad": _rad(tilt["pitch"]),
        "verdict": quality["verdict"],
        "warnings": "\n".join(content["warnings"]),
    }


def _rad(mgon: float | None) -> float | None:
    return None if mgon is None else mgon * MGON


def _links(folder: Path, start: Path) -> dict[str, str | None]:
    """Links to the pages and pictures of a campaign, relative to the folder of the overview."""
    places = {"report": "report.html", "holds": "campaign/segmentation.png"}
    links = {
        key: (folder / place).relative_to(start).as_posix() if (folder / place).exists() else None
        for key, place in places.items()
    }
    return {**links, "folder": folder.as_posix()}


def _next_steps(rows: list[dict[str, Any]]) -> list[tuple[str, str]]:
    """Commands for the first good and for the first doubtful campaign, each with its purpose."""
    steps = []
    good = next((row for row in rows if row["state"] in (ACCEPTED, UNCHECKED)), None)
    if good is not None:
        command = suggested.apply(f"{good['folder']}/calibration.json")
        steps.append(("Level a log, for example", command))
    doubtful = next((row for row in rows if row["state"] in (REJECTED, IMPLAUSIBLE)), None)
    if doubtful is not None:
        is_folder = doubtful["kind"] == "campaign"
        measured = doubtful["source"] if is_folder else f"{doubtful['folder']}/campaign"
        command = suggested.diagnose(measured, doubtful["model"], doubtful["approach"])
        steps.append(("Find what is wrong or missing, for example", command))
    return steps


def _page(batch: str, table: pd.DataFrame, links: list[dict[str, str | None]]) -> str:
    """Page (HTML, self-contained apart from its links), failures first."""
    rows = [
        {**{k: None if pd.isna(v) else v for k, v in row.items()}, **link}
        for row, link in zip(table.to_dict("records"), links, strict=True)
    ]
    return render(
        "campaign/batch/overview.html.j2",
        batch=batch,
        failed=[row for row in rows if row["status"] != "ok"],
        implausible=[row for row in rows if row["state"] == IMPLAUSIBLE],
        calibrated=[row for row in rows if row["status"] == "ok" and row["state"] != IMPLAUSIBLE],
        level=REFUTED,
        robot=table["held_out_roll_rad"].notna().any(),
        blind=BLIND,
        next_steps=_next_steps(rows),
    )

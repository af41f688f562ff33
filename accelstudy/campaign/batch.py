"""Calibrate one campaign of a batch, so that a bad one is reported and stops no other."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from accelstudy.approaches import get_approach
from accelstudy.campaign.batch_config import Task
from accelstudy.campaign.fit import fit_campaign
from accelstudy.campaign.format import Campaign, read_campaign
from accelstudy.campaign.importing import import_to
from accelstudy.campaign.output import write_calibration
from accelstudy.campaign.public import read_record
from accelstudy.errors import InputError
from accelstudy.models import get_model
from accelstudy.study.tables import whole_file

STATUS = "status.json"


def run_task(task: Task, folder: str | Path, record: str | Path | None = None) -> str | None:
    """Import and calibrate a campaign, and write how it went to status.json, which comes last.

    Parameters
    ----------
    task : Task
    folder : path
        For what `write_calibration` writes; an imported campaign goes to its subfolder campaign.
    record : path
        Of public data, written by `accelstudy.campaign.public.record_public`.

    Returns
    -------
    str
        What is wrong with the input, in one line; None if it was calibrated.
    """
    folder = Path(folder)
    error = None
    try:
        campaign = _measured(task, folder / "campaign", record)
        fit = fit_campaign(campaign, get_model(task.model), get_approach(task.approach))
        write_calibration(fit, folder)
    except InputError as wrong:
        error = " ".join(str(wrong).split()).removeprefix(f"{task.name}: ")
    status = {
        **task.model_dump(mode="json", include={"name", "kind", "source", "model", "approach"}),
        "status": "ok" if error is None else "failed",
        "error": error,
    }
    with whole_file(folder / STATUS) as path:
        path.write_text(json.dumps(status, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return error


def _measured(task: Task, folder: Path, record: str | Path | None) -> Campaign:
    if task.settings is None:
        gravity = task.gravity
        return read_campaign(task.source, {"gravity": gravity.model_dump()} if gravity else None)
    path = task.source if record is None else _recorded(record)
    return import_to(folder, path, task.settings)[0]


def _recorded(path: str | Path) -> str:
    record: dict[str, Any] = read_record(path)
    if record["error"] is not None:
        raise InputError(record["error"])
    return record["file"]

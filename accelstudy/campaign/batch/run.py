"""Calibration of one campaign of a batch; a failure is reported and does not stop the others."""

from __future__ import annotations

import json
import logging
import shutil
from pathlib import Path

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import one_line
from accelstudy.campaign.batch.config import CampaignEntry
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.calibration.result import Calibration
from accelstudy.campaign.format import read_campaign
from accelstudy.campaign.importing.logs import import_log, write_imported
from accelstudy.campaign.session import Campaign
from accelstudy.files.outputs import BATCH_JOB, result_folder
from accelstudy.sensors.models import get_model


def run_task(
    task: CampaignEntry,
    folder: str | Path,
    public: str | Path | None = None,
    log: str | Path | None = None,
) -> str | None:
    """Import and calibrate a campaign, and write the outcome to status.json.

    Parameters
    ----------
    task : CampaignEntry
    folder : path
        For the files of a calibration; an imported campaign goes to its subfolder campaign.
    public : path
        File of public data.
    log : path
        File with the traceback of an unexpected error.

    Returns
    -------
    str
        What is wrong, in one line; None if it was calibrated.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    with result_folder(folder, BATCH_JOB) as new:
        error = _calibrate(task, new, public, log)
        status = {
            **{key: getattr(task, key) for key in ("name", "kind", "source", "model", "approach")},
            "status": "ok" if error is None else "failed",
            "error": error,
        }
        text = json.dumps(status, indent=2, ensure_ascii=False) + "\n"
        (new / BATCH_JOB.marker).write_text(text, encoding="utf-8")
    return error


def _calibrate(
    task: CampaignEntry, folder: Path, public: str | Path | None, log: str | Path | None
) -> str | None:
    """Import and calibrate into a folder; say what is wrong, and leave no half of a result."""
    try:
        if task.settings is None:
            campaign = _read(task)
        else:
            campaign, holds = import_log(public or task.source, task.settings)
            write_imported(campaign, holds, folder / "campaign")
        approach = None if task.approach is None else get_approach(task.approach)
        fit = fit_campaign(campaign, get_model(task.model), approach)
        Calibration(fit).write(folder, Path())
        return None
    except InputError as error:
        wrong = " ".join(str(error).split()).removeprefix(f"{task.name}: ")
    except OSError:  # such as a full disk, which is not the campaign's fault
        raise
    except Exception as error:
        # One campaign must not cost the others their overview.
        logging.exception("%s: not foreseen", task.name)
        see = "" if log is None else f"; the log has the details: {log}"
        wrong = f"internal error, please report it ({type(error).__name__}: {one_line(error)}){see}"
    for name in BATCH_JOB.files:  # the campaign that was imported stays
        (folder / name).unlink(missing_ok=True)
    shutil.rmtree(folder / "figures", ignore_errors=True)
    return wrong


def _read(task: CampaignEntry) -> Campaign:
    gravity = task.gravity
    return read_campaign(task.source, {"gravity": gravity.model_dump()} if gravity else None)

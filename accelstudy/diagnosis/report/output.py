"""What a diagnosis writes: JSON, YAML, Parquet, figures and a page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import stage
from accelstudy.campaign.calibration.document import json_text
from accelstudy.campaign.format import read_campaign
from accelstudy.diagnosis.loop import REPLICATES, Loop, close_loop
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.document.calibration import diagnosed_calibration
from accelstudy.diagnosis.report.document.diagnosis import diagnosis_document
from accelstudy.diagnosis.report.document.model_file import study_overlay
from accelstudy.diagnosis.report.document.positions import positions_table
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.files.outputs import DIAGNOSIS, result_folder, whole_file
from accelstudy.files.parquet import write_frame
from accelstudy.sensors.models import get_model


def diagnose_folder(
    campaign: str | Path,
    out: str | Path,
    model: str = "bias-scale-nonorthogonality",
    approach: str | None = None,
    seed: int = 1,
    replicates: int = REPLICATES,
    force: bool = False,
) -> Diagnosis:
    """Diagnose a campaign folder, close the loop, and write all of it.

    Parameters
    ----------
    campaign, out : paths of folders
    model, approach : str, names; robot-aided by default if the campaign has a robot
    seed : int
    replicates : int, sessions simulated with the old and with the new model
    force : bool, as in `accelstudy.files.outputs.result_folder`

    Raises
    ------
    InputError
        If the input cannot be used, or `out` not be written; nothing is written then.
    """
    chosen = get_model(model), None if approach is None else get_approach(approach)
    with result_folder(out, DIAGNOSIS, [campaign], force) as folder, stage("diagnosis"):
        # The diagnosis, not the reader, looks for wrong units and axes.
        measured = read_campaign(campaign, plausible=False)
        with stage("search for what is missing"):
            diagnosis = diagnose(measured, *chosen, seed=seed)
        loop = close_loop(diagnosis, replicates, seed)
        with stage("figures and page"):
            write_diagnosis(diagnosis, folder, loop=loop, source=campaign, place=out)
    return diagnosis


def write_diagnosis(
    diagnosis: Diagnosis,
    folder: str | Path,
    report: bool = True,
    loop: Loop | None = None,
    source: str | Path = "CAMPAIGN",
    place: str | Path = "",
) -> dict[str, Any]:
    """Write what a diagnosis found; each file is whole or not there, diagnosis.json comes last.

    Parameters
    ----------
    diagnosis : Diagnosis
    folder : path, made if it is not there
    report : bool, whether to write figures/ and report.html beside the files for programs
    loop : Loop, optional, simulations with the old and with the new model
    source, place : paths of the campaign and of the results, for the commands that the page gives

    Returns
    -------
    dict
        The content of diagnosis.json.
    """
    folder = Path(folder)
    document = diagnosis_document(diagnosis)
    if loop is not None:
        document["loop"] = loop.document
        write_frame(folder / "loop.parquet", loop.sessions)
    positions = positions_table(diagnosis)
    write_frame(folder / "positions.parquet", positions)
    calibration = _calibration(diagnosis, document)
    if calibration is not None:
        with whole_file(folder / "calibration.json") as path:
            path.write_text(json_text(calibration), encoding="utf-8")
    with whole_file(folder / "model.yaml") as path:
        text = yaml.safe_dump(study_overlay(diagnosis), sort_keys=False, allow_unicode=True)
        path.write_text(MODEL_HEADER + text, encoding="utf-8")
    if report:
        # Drawing takes as long to import as all of the above to compute.
        from accelstudy.diagnosis.report.page.report import write_report

        write_report(diagnosis, document, positions, loop, folder, calibration, source, place)
    with whole_file(folder / "diagnosis.json") as path:
        path.write_text(json_text(document), encoding="utf-8")
    return document


def _calibration(diagnosis: Diagnosis, document: dict[str, Any]) -> dict[str, Any] | None:
    """Content of calibration.json; None, with the reason in the document, if there is none."""
    try:
        content = diagnosed_calibration(diagnosis)
    except (InputError, np.linalg.LinAlgError) as error:
        document["calibration"] = {"file": None, "reason": str(error)}
        return None
    document["calibration"] = {"file": "calibration.json", "mended": content["mended"]}
    return content


MODEL_HEADER = """\
# The sensor and the noise that were found, as a study of their own:
# snakemake --cores 2 --configfile config/config.yaml THIS_FILE
"""

"""What a diagnosis writes: JSON, YAML, Parquet, figures and a page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from accelstudy.basics import suggestions
from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.document import write_json
from accelstudy.campaign.calibration.sensor_calibration import needs_of, unknown
from accelstudy.diagnosis.report import words
from accelstudy.diagnosis.report.document import (
    diagnosed_calibration,
    diagnosis_document,
    positions_table,
    study_overlay,
)
from accelstudy.diagnosis.report.figures import diagnosis_figures
from accelstudy.diagnosis.result import MISSING, Diagnosis
from accelstudy.diagnosis.rules import RULES
from accelstudy.drawing.saving import save_all
from accelstudy.files.outputs import whole_file
from accelstudy.files.parquet import write_frame
from accelstudy.pages import write_page

MODEL_HEADER = """\
# The sensor and the noise that were found, as a study of their own:
# snakemake --cores 2 --configfile config/config.yaml THIS_FILE
"""


def write_diagnosis(
    diagnosis: Diagnosis,
    folder: str | Path,
    source: str | Path = "CAMPAIGN",
    place: str | Path = "",
) -> dict[str, Any]:
    """Write what a diagnosis found; each file is whole or not there, diagnosis.json comes last.

    Parameters
    ----------
    diagnosis : Diagnosis
    folder : path, made if it is not there
    source, place : paths of the campaign and of the results, for the commands that the page gives

    Returns
    -------
    dict
        The content of diagnosis.json.
    """
    folder = Path(folder)
    document, calibration = diagnosis_document(diagnosis), None
    positions = positions_table(diagnosis)
    write_frame(folder / "positions.parquet", positions)
    try:
        calibration = diagnosed_calibration(diagnosis)
    except (InputError, np.linalg.LinAlgError) as error:
        document["calibration"] = {"file": None, "reason": str(error)}
    else:
        write_json(folder / "calibration.json", calibration)
        document["calibration"] = {"file": "calibration.json", "mended": calibration["mended"]}
    with whole_file(folder / "model.yaml") as path:
        text = yaml.safe_dump(study_overlay(diagnosis), sort_keys=False, allow_unicode=True)
        path.write_text(MODEL_HEADER + text, encoding="utf-8")
    lines = words.verdict_lines(diagnosis)
    write_page(
        folder / "report.html",
        "diagnosis/report/report.html.j2",
        " ".join(lines),
        d=diagnosis,
        doc=document,
        w=words,
        lines=lines,
        figures=save_all(diagnosis_figures(diagnosis, positions), folder / "figures"),
        calibration=calibration,
        rules=RULES,
        missing=MISSING,
        next_steps=next_steps(diagnosis, calibration, source, place),
    )
    write_json(folder / "diagnosis.json", document)
    return document


def next_steps(
    diagnosis: Diagnosis,
    calibration: Mapping[str, Any] | None,
    campaign: str | Path,
    place: str | Path,
) -> list[tuple[str, str]]:
    """Say what to do next, most urgent first: what for, and the command.

    Parameters
    ----------
    diagnosis : Diagnosis
    calibration : mapping, of `diagnosed_calibration`; None if there is none
    campaign, place : paths of the folders of the campaign and of the results
    """
    d, steps = diagnosis, []
    chosen = (campaign, d.model.name, d.approach.name, d.campaign.prior)
    result = Path(place) / suggestions.HERE
    if d.recognised is not None:
        command = suggestions.calibrate(*chosen)
        steps.append(("Correct the campaign, and calibrate it then", command))
    if d.verdict in ("narrowed", "unknown", "learned"):
        which = "the next positions" if d.next_positions else "positions"
        what = f"Add {which} to the campaign, and diagnose it again"
        steps.append((what, suggestions.diagnose(*chosen)))
    if d.better_for_leveling == "base":
        command = suggestions.calibrate(*chosen)
        return [*steps, ("Calibrate with the base model, which levels better", command)]
    if calibration is None or not calibration["quality"]["plausible"]:
        return steps
    use = "Level a log with the calibration that is beside this page"
    steps.append((use, suggestions.apply(result)))
    on_device = [effect for effect in d.extended_model.effects if effect.part == "sensor"]
    if not unknown(needs_of(on_device)):
        steps.append(("Take it to a device", suggestions.export("c", result)))
    if d.extended_model is not d.model:
        command = suggestions.calibrate("CAMPAIGN", Path(place) / "model.yaml", d.approach.name)
        steps.append(("Calibrate the next campaign with this model", command))
    return steps

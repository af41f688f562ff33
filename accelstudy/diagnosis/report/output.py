"""What a diagnosis writes: JSON, YAML, Parquet, figures and a page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from accelstudy.basics import suggested
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import REFUTED
from accelstudy.campaign.calibration.applying import needs_of
from accelstudy.campaign.calibration.device import unknown
from accelstudy.campaign.calibration.document import write_json
from accelstudy.diagnosis.consequences import MISSING
from accelstudy.diagnosis.decision.posterior import CREDIBLE
from accelstudy.diagnosis.decision.priors import SURE
from accelstudy.diagnosis.decision.verdict import LEVEL_NOISE
from accelstudy.diagnosis.loop import Loop
from accelstudy.diagnosis.report import words as wording
from accelstudy.diagnosis.report.document import (
    diagnosed_calibration,
    diagnosis_document,
    effect_document,
    positions_table,
    study_overlay,
)
from accelstudy.diagnosis.report.figures import diagnosis_figures, hardly_shown
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.diagnosis.space.examined import IMITATES
from accelstudy.drawing.saving import save_all
from accelstudy.effects import effect_names, get_effect
from accelstudy.files.outputs import whole_file
from accelstudy.files.parquet import write_frame
from accelstudy.pages import write_page


def write_diagnosis(
    diagnosis: Diagnosis,
    folder: str | Path,
    loop: Loop | None = None,
    source: str | Path = "CAMPAIGN",
    place: str | Path = "",
) -> dict[str, Any]:
    """Write what a diagnosis found; each file is whole or not there, diagnosis.json comes last.

    Parameters
    ----------
    diagnosis : Diagnosis
    folder : path, made if it is not there
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
        write_json(folder / "calibration.json", calibration)
    with whole_file(folder / "model.yaml") as path:
        text = yaml.safe_dump(study_overlay(diagnosis), sort_keys=False, allow_unicode=True)
        path.write_text(MODEL_HEADER + text, encoding="utf-8")
    _write_report(diagnosis, document, positions, folder, calibration, source, place)
    write_json(folder / "diagnosis.json", document)
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


def _write_report(
    diagnosis: Diagnosis,
    document: dict[str, Any],
    positions: pd.DataFrame,
    folder: Path,
    calibration: dict[str, Any] | None,
    source: str | Path,
    place: str | Path,
) -> None:
    """Write figures/ and report.html.

    Parameters
    ----------
    diagnosis : Diagnosis
    document : dict, of `diagnosis_document`
    positions : DataFrame, of `positions_table`
    folder : Path
    calibration : dict, of `diagnosed_calibration`, optional
    source, place : paths of the campaign and of the results, for the commands that the page gives
    """
    drawn = save_all(diagnosis_figures(diagnosis, positions), folder / "figures")
    lines = wording.verdict_lines(diagnosis)
    write_page(
        folder / "report.html",
        "diagnosis/report/report.html.j2",
        " ".join(lines),
        d=diagnosis,
        doc=document,
        missing=MISSING,
        effects=[effect_document(named) for named in diagnosis.found],
        verdict=wording.badge(diagnosis),
        headline=lines[0],
        lines=lines[1:],
        sentence=wording.sentence,
        described=wording.described,
        confirmation=wording.confirmation(diagnosis),
        advice=wording.advice(diagnosis),
        stands_for=wording.stands_for(diagnosis),
        equation=lambda effect: get_effect(effect["spec"]).equation,
        possible=lambda effect: wording.possible(effect["spec"]),
        is_effect=lambda name: name in effect_names(),
        called=lambda effect: wording.called(effect["name"], effect["spec"]),
        figures=drawn,
        beyond=wording.beyond(diagnosis),
        small_dots=diagnosis.shape is not None and bool(hardly_shown(diagnosis.shape).any()),
        changed=wording.changed(diagnosis),
        keep_base=wording.keep_base(diagnosis),
        calibration=calibration,
        added=diagnosis.extended is not diagnosis.model,
        judged=wording.judged(diagnosis),
        may_be_an_effect=wording.may_be_an_effect(diagnosis),
        question=wording.question(diagnosis.next_positions),
        family=wording.family_words,
        shares_a_direction=IMITATES,
        credible=CREDIBLE,
        wrong=round(10 * SURE),
        withheld=round(10 * (1 - SURE)),
        level=diagnosis.level,
        level_noise=LEVEL_NOISE,
        level_sigma=REFUTED,
        sure=SURE,
        next_steps=next_steps(diagnosis, calibration, source, place),
    )


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
    result = Path(place) / suggested.HERE
    if d.recognised is not None:
        command = suggested.calibrate(*chosen)
        steps.append(("Correct the campaign, and calibrate it then", command))
    if d.verdict in ("narrowed", "unknown", "learned"):
        which = "the next positions" if d.next_positions else "positions"
        what = f"Add {which} to the campaign, and diagnose it again"
        steps.append((what, suggested.diagnose(*chosen)))
    if d.better_for_leveling == "base":
        command = suggested.calibrate(*chosen)
        return [*steps, ("Calibrate with the base model, which levels better", command)]
    if calibration is None or not calibration["quality"]["plausible"]:
        return steps
    use = "Level a log with the calibration that is beside this page"
    steps.append((use, suggested.apply(result)))
    on_device = [effect for effect in d.extended.effects if effect.part == "sensor"]
    form = "json" if unknown(needs_of(on_device)) else "c"
    steps.append(("Take it to a device", suggested.export(form, result)))
    if d.extended is not d.model:
        command = suggested.calibrate("CAMPAIGN", Path(place) / "model.yaml", d.approach.name)
        steps.append(("Calibrate the next campaign with this model", command))
    return steps

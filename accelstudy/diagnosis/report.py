"""The page about a diagnosis, with its figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from accelstudy.campaign.gauges import not_affine
from accelstudy.diagnosis import wording
from accelstudy.diagnosis.figures import diagnosis_figures
from accelstudy.diagnosis.loop import Loop
from accelstudy.diagnosis.pipeline import LEVEL_NOISE, Diagnosis
from accelstudy.diagnosis.search import LEVEL_EFFECTS, SURE
from accelstudy.effects import effect_names, get_effect
from accelstudy.figures.saving import save_all
from accelstudy.outputs import whole_file
from accelstudy.pages import page_environment
from accelstudy.wording import joined, p_value, probability


def write_report(
    diagnosis: Diagnosis,
    document: dict[str, Any],
    positions: pd.DataFrame,
    loop: Loop | None,
    folder: Path,
    calibration: dict[str, Any] | None = None,
) -> None:
    """Write figures/ and report.html.

    Parameters
    ----------
    diagnosis : Diagnosis
    document : dict, of `diagnosis_document`
    positions : DataFrame, of `positions_table`
    loop : Loop, optional
    folder : Path
    calibration : dict, of `diagnosed_calibration`, optional
    """
    drawn = save_all(diagnosis_figures(diagnosis, positions, loop), folder / "figures")
    environment = page_environment("diagnosis", trim_blocks=True, lstrip_blocks=True)
    environment.filters.update(
        p=probability,
        p_value=p_value,
        words=wording.words,
        joined=joined,
        sentence=wording.sentence,
        described=wording.described,
    )
    page = environment.get_template("report.html.j2").render(
        d=diagnosis,
        doc=document,
        headline=wording.headline(diagnosis),
        lines=wording.verdict_lines(diagnosis)[1:],
        confirmation=wording.confirmation(diagnosis),
        advice=wording.advice(diagnosis),
        equation=lambda effect: get_effect(effect["spec"]).equation,
        is_effect=lambda name: name in effect_names(),
        amount=wording.amount,
        unit=wording.shown_unit,
        estimate=wording.estimate,
        figures=drawn,
        calibration=calibration,
        tells=not_affine(diagnosis.extended),
        level=LEVEL_EFFECTS,
        level_noise=LEVEL_NOISE,
        sure=SURE,
    )
    with whole_file(folder / "report.html") as path:
        path.write_text(page, encoding="utf-8")

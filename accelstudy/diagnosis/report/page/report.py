"""The page about a diagnosis, with its figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from accelstudy.basics.levels import REFUTED
from accelstudy.diagnosis.decision.explanations import CREDIBLE
from accelstudy.diagnosis.decision.noise import LEVEL_NOISE
from accelstudy.diagnosis.decision.priors import SURE
from accelstudy.diagnosis.loop import Loop
from accelstudy.diagnosis.report.figures.choice import diagnosis_figures
from accelstudy.diagnosis.report.page.next_steps import next_steps
from accelstudy.diagnosis.report.words import summary as wording
from accelstudy.diagnosis.report.words.missing import family_words, question
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.diagnosis.space.examined import IMITATES
from accelstudy.drawing.saving import save_all
from accelstudy.effects import effect_names, get_effect
from accelstudy.pages import write_page


def write_report(
    diagnosis: Diagnosis,
    document: dict[str, Any],
    positions: pd.DataFrame,
    loop: Loop | None,
    folder: Path,
    calibration: dict[str, Any] | None = None,
    source: str | Path = "CAMPAIGN",
    place: str | Path = "",
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
    source, place : paths of the campaign and of the results, for the commands that the page gives
    """
    drawn = save_all(diagnosis_figures(diagnosis, positions, loop), folder / "figures")
    lines = wording.verdict_lines(diagnosis)
    write_page(
        folder / "report.html",
        "diagnosis/report/page/report.html.j2",
        " ".join(lines),
        d=diagnosis,
        doc=document,
        groups=wording.GROUPS,
        verdict="cannot tell" if wording.too_few(diagnosis) else diagnosis.verdict,
        headline=lines[0],
        lines=lines[1:],
        sentence=wording.sentence,
        described=wording.described,
        confirmation=wording.confirmation(diagnosis),
        advice=wording.advice(diagnosis),
        equation=lambda effect: get_effect(effect["spec"]).equation,
        is_effect=lambda name: name in effect_names(),
        amount=wording.amount,
        unit=wording.shown_unit,
        estimate=wording.estimate,
        figures=drawn,
        changed=wording.changed(diagnosis),
        keep_base=wording.keep_base(diagnosis),
        calibration=calibration,
        added=diagnosis.extended is not diagnosis.model,
        judged=wording.judged(diagnosis),
        question=question(diagnosis.next_positions),
        family=family_words,
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

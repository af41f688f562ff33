"""What a calibration writes: JSON, Parquet, figures and a page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from accelstudy.basics.levels import REFUTED
from accelstudy.basics.suggested import HERE
from accelstudy.basics.units import display_unit, to_display, unit_label
from accelstudy.basics.wording import number
from accelstudy.campaign.calibration.assessment import assess
from accelstudy.campaign.calibration.document import (
    assessed_positions,
    calibration_document,
    json_text,
    quality_document,
)
from accelstudy.campaign.calibration.figures import correlation_figure, residual_figure
from accelstudy.campaign.calibration.fit import CampaignFit
from accelstudy.campaign.calibration.wording import next_steps, verdict_lines
from accelstudy.drawing.saving import save_all
from accelstudy.files.outputs import whole_file
from accelstudy.files.parquet import write_frame
from accelstudy.pages import write_page

LISTED = 200
"""Positions up to which the page lists all of them; of more, those that fit worst."""


def write_calibration(
    fit: CampaignFit,
    folder: str | Path,
    source: str | Path = "CAMPAIGN",
    place: str | Path = "",
) -> dict[str, Any]:
    """Assess a fit and write calibration.json, positions.parquet, figures/ and report.html.

    Each file is whole or not there; calibration.json comes last. If the page fails, the numbers are
    written all the same.

    Parameters
    ----------
    fit : CampaignFit
    folder : path, to write to
    source, place : paths of the campaign and of the results, for the commands that the page gives

    Returns
    -------
    dict
        The content of calibration.json.
    """
    folder = Path(folder)
    assessment = assess(fit)
    document = calibration_document(fit)
    quality = quality_document(assessment)
    positions = assessed_positions(assessment)
    drawn = save_all(
        {
            "residuals": lambda: residual_figure(fit, positions),
            "correlations": lambda: correlation_figure(fit),
        },
        folder / "figures",
    )
    write_frame(folder / "positions.parquet", positions)

    lines = verdict_lines(assessment)
    write_page(
        folder / "report.html",
        "campaign/calibration/report.html.j2",
        " ".join(lines),
        doc=document,
        quality=quality,
        lines=lines,
        positions=_listed(positions).to_dict("records"),
        shown=_shown,
        unit=lambda unit: unit_label(display_unit(unit)),
        refuted=REFUTED,
        figures=drawn,
        next_steps=next_steps(fit, assessment.state, source, Path(place) / HERE),
    )
    content = {**document, "quality": quality}
    with whole_file(folder / "calibration.json") as path:
        path.write_text(json_text(content), encoding="utf-8")
    return content


def _listed(positions: pd.DataFrame) -> pd.DataFrame:
    """Positions that the page lists, in their order: all, or those that fit worst."""
    worst = positions.sort_values(["suspect", "p_value"], ascending=[False, True], kind="stable")
    return worst.head(LISTED).sort_index()


def _shown(parameter: dict[str, Any], value: float | None) -> str:
    """Show an SI value of a parameter in the unit of the page."""
    return "–" if value is None else number(to_display(value, parameter["unit"]).item())

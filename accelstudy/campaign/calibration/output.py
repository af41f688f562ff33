"""What a calibration writes: JSON, Parquet, figures and a page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from accelstudy.basics.levels import REFUTATION_LEVEL
from accelstudy.basics.suggestions import HERE
from accelstudy.campaign.calibration.assessment import Assessment
from accelstudy.campaign.calibration.document import (
    assessed_positions,
    calibration_document,
    quality_document,
    write_json,
)
from accelstudy.campaign.calibration.fit import CampaignFit
from accelstudy.campaign.calibration.wording import next_steps, verdict_lines
from accelstudy.drawing.saving import save_all
from accelstudy.drawing.style import FULL, INK, approach_colour, ink_on, new_figure, symbol
from accelstudy.files.parquet import write_frame
from accelstudy.pages import write_page

SUSPECT = "#D55E00"
MAX_ROWS = 200
"""Positions up to which the page lists all of them; of more, those that fit worst."""


def write_calibration(
    assessment: Assessment,
    folder: str | Path,
    source: str | Path = "CAMPAIGN",
    place: str | Path = "",
) -> dict[str, Any]:
    """Write calibration.json, positions.parquet, figures/ and report.html.

    Each file is whole or not there; calibration.json comes last. If the page fails, the numbers are
    written all the same.

    Parameters
    ----------
    assessment : Assessment, of a fit
    folder : path, to write to
    source, place : paths of the campaign and of the results, for the commands that the page gives

    Returns
    -------
    dict
        The content of calibration.json.
    """
    folder, fit = Path(folder), assessment.fit
    content = calibration_content(assessment)
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
        doc=content,
        quality=content["quality"],
        lines=lines,
        angles_unused=fit.campaign.angles is not None and not fit.approach.uses_angles,
        positions=_listed(positions).to_dict("records"),
        refuted=REFUTATION_LEVEL,
        figures=drawn,
        next_steps=next_steps(fit, assessment.state, source, Path(place) / HERE),
    )
    write_json(folder / "calibration.json", content)
    return content


def calibration_content(assessment: Assessment) -> dict[str, Any]:
    """Content of calibration.json."""
    return {**calibration_document(assessment.fit), "quality": quality_document(assessment)}


def _listed(positions: pd.DataFrame) -> pd.DataFrame:
    """Positions that the page lists, in their order: all, or those that fit worst."""
    worst = positions.sort_values(["suspect", "p_value"], ascending=[False, True], kind="stable")
    return worst.head(MAX_ROWS).sort_index()


def residual_figure(fit: CampaignFit, positions: pd.DataFrame) -> Figure:
    """|f_b| − g of each position, with a band of two standard deviations.

    The band shows the stated noise if there is one, so that residuals that are too large for it
    look so. Otherwise it shows the noise that the residuals have themselves.
    """
    figure = new_figure(FULL, 62)
    draw_residuals(figure.add_subplot(), fit, positions)
    return figure


def draw_residuals(ax: Axes, fit: CampaignFit, positions: pd.DataFrame) -> None:
    """Draw what `residual_figure` shows."""
    x, y = positions["position"], 1e3 * positions["norm_residual_mps2"]
    stated = fit.campaign.sigma_force
    two_sigma = 2e3 * (fit.sigma_position if stated is None else stated)
    source = "from the residuals" if stated is None else "as stated"
    if np.isfinite(two_sigma):
        ax.axhspan(-two_sigma, two_sigma, color="#E6E6E6", label=f"±2 σ of a position, {source}")
    ax.axhline(0, color=INK, linewidth=0.8)
    ax.plot(x, y, "o", color=approach_colour(fit.approach.name), label="residual |f| − g")
    suspects = positions["suspect"]
    if suspects.any():
        ax.plot(x[suspects], y[suspects], "o", markersize=9, markerfacecolor="none",
                color=SUSPECT, label="in conflict with the others")  # fmt: skip
    ax.set(xlabel="position", ylabel="|f| − g / (mm/s²)")
    ax.margins(x=0.02)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.15), ncols=3)


def correlation_figure(fit: CampaignFit) -> Figure:
    """Correlations of the parameters."""
    sigma = fit.sigma
    correlation = fit.covariance / np.outer(sigma, sigma)
    names = [symbol(name) for name in fit.model.parameter_names]
    figure = new_figure(FULL * 0.6, 85)
    ax = figure.add_subplot()
    image = ax.imshow(correlation, cmap="RdBu_r", vmin=-1, vmax=1)
    ax.set_xticks(range(len(names)), names)
    ax.set_yticks(range(len(names)), names)
    ax.grid(False)
    for (i, j), value in np.ndenumerate(correlation):
        if i != j and abs(value) >= 0.1:
            text = f"{value:.1f}".replace("-", "−")
            ax.text(j, i, text, ha="center", va="center", fontsize=6,
                    color=ink_on(image, value))  # fmt: skip
    figure.colorbar(image, label="correlation")
    return figure

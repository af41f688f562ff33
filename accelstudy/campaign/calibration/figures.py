"""The figures of a calibration: residuals of the positions, and correlations of the parameters."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from accelstudy.campaign.calibration.campaign_fit import CampaignFit
from accelstudy.drawing.style import FULL, INK, approach_colour, matrix, new_figure, symbol

SUSPECT = "#D55E00"
"""Colour of a position in conflict with the others."""


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
    texts = np.char.replace(np.char.mod("%.1f", correlation), "-", "−")
    texts[np.eye(len(names), dtype=bool) | ~(np.abs(correlation) >= 0.1)] = ""
    image = matrix(
        figure.add_subplot(), names, names, correlation, texts, cmap="RdBu_r", vmin=-1, vmax=1
    )
    figure.colorbar(image, label="correlation")
    return figure

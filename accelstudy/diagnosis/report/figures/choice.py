"""Which figures a diagnosis has."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from accelstudy.diagnosis.loop import Loop
from accelstudy.diagnosis.report.figures.evidence import evidence_figure, location_figure
from accelstudy.diagnosis.report.figures.explanations import explanations_figure
from accelstudy.diagnosis.report.figures.gap import gap_figure, loop_figure
from accelstudy.diagnosis.report.figures.residuals import residual_figure
from accelstudy.diagnosis.result import Diagnosis

Array = NDArray[np.float64]


def diagnosis_figures(
    diagnosis: Diagnosis, positions: pd.DataFrame, loop: Loop | None = None
) -> dict[str, Callable[[], Figure]]:
    """Return a function that draws each figure; figures that would show nothing are left out.

    Parameters
    ----------
    diagnosis : Diagnosis
    positions : DataFrame, of `positions_table`
    loop : Loop, optional
    """
    d = diagnosis
    figures: dict[str, Callable[[], Figure]] = {"residuals": lambda: residual_figure(d, positions)}
    if d.screening.p_family:
        figures["evidence"] = lambda: evidence_figure(d)
    if len(d.credible_set) > 1:
        figures["explanations"] = lambda: explanations_figure(d.credible_set)
    if d.gap.held_out is not None:
        figures["gap"] = lambda: gap_figure(d, positions)
    # Without sigma, no size of the residuals is too large for noise.
    if any(d.location.values()) and (d.sigma_known or d.verdict != "noise_model"):
        figures["location"] = lambda: location_figure(d)
    if loop is not None:
        figures["loop"] = lambda: loop_figure(loop)
    return figures

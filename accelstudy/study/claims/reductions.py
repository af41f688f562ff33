"""How far the robot reduces the sds a posteriori of single calibrations, from their estimates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.study.cell import Cell
from accelstudy.study.monte_carlo.control import Control
from accelstudy.study.monte_carlo.distributions import (
    EDGES,
    PROBABILITIES,
    Controlled,
    Sample,
    apart_by_quantile,
)
from accelstudy.study.monte_carlo.followed import EFFECT, cell_tilt_error
from accelstudy.study.monte_carlo.replicates import Replicates, read_replicates
from accelstudy.study.monte_carlo.statistics import Statistics

Array = NDArray[np.float64]
CENTRAL = [PROBABILITIES.tolist().index(p) for p in (0.975, 0.5, 0.025)]


def reductions(
    cells: Iterable[Cell],
    estimates: Sequence[str | Path],
    leveling: Mapping[str, Any],
    papers: Mapping[str, float],
) -> pd.DataFrame:
    """Reductions, %, of the sd of some effects, robot-aided against gravity-based.

    Parameters
    ----------
    cells : cells with the model of the claims
    estimates : files with the estimates of these cells
    leveling : mapping with max_tilt_gon and attitudes
    papers : the paper's number for each effect

    Returns
    -------
    DataFrame
        One row per scheme in which both calibrations have redundancy, and effect: `mean` with
        `half` of its 95 % interval; of single simulations `single_low`, `median` and `single_high`
        (the central 95 %) and `percentile`, the share below the paper's number.
    """
    calibrations: dict[tuple[str, str], _Calibrations] = {}
    for cell in cells:
        read = _Calibrations.read(cell, estimates, leveling)
        if read is not None and read.statistics.redundancy > 0 and read.statistics.converged:
            calibrations[cell.scheme, cell.approach] = read
    rows: list[dict[str, Any]] = []
    for effect, paper in papers.items():
        for (scheme, approach), gravity in calibrations.items():
            robot = calibrations.get((scheme, "robot"))
            if approach == "gravity" and robot is not None:
                numbers = _reduction(gravity, robot, effect, paper)
                rows.append({"scheme": scheme, "effect": effect, **numbers})
    return pd.DataFrame(rows)


class _Calibrations(NamedTuple):
    """The calibrations of a cell."""

    statistics: Statistics
    control: Control | None
    replicates: Replicates

    @classmethod
    def read(
        cls, cell: Cell, estimates: Sequence[str | Path], leveling: Mapping[str, Any]
    ) -> _Calibrations | None:
        """Read those of a cell; None if there are none."""
        if not cell.estimability.estimable:
            return None
        tilt = cell_tilt_error(cell, leveling)
        control = Control.of(cell, tilt)
        replicates = read_replicates(estimates, cell, control)
        if replicates is None:
            return None
        return cls(Statistics.of(cell, replicates, control, tilt), control, replicates)

    def mean(self, effect: str) -> tuple[float, float]:
        """Mean sigma a posteriori of an effect with its standard error, SI."""
        mean = self.statistics.mean(EFFECT)[list(self.statistics.followed.effects).index(effect)]
        return float(mean.value), float(mean.error)

    def sigmas(self, effect: str) -> tuple[Array, Array]:
        """Sigma of an effect in the calibrations that converged, and by linear theory."""
        followed, (simulated, linear) = self.statistics.followed, self.replicates
        column = followed.keys.index((EFFECT, effect))
        own = followed.values(simulated)[:, column]
        if linear is None:
            return own, own
        return own, followed.values(linear)[simulated.converged, column]


def _reduction(
    gravity: _Calibrations, robot: _Calibrations, effect: str, paper: float
) -> dict[str, float]:
    """Columns of `reductions` for one scheme and effect."""
    (below, error_below), (above, error_above) = gravity.mean(effect), robot.mean(effect)
    mean, ratio = 100 * (1 - above / below), _ratio(gravity, robot, effect)
    low, median, high = 100 * (1 - ratio.quantile(np.array(CENTRAL)).value)
    return {
        "mean": mean,
        "half": 1.96 * (100 - mean) * float(np.hypot(error_above / above, error_below / below)),
        "single_low": float(low),
        "median": float(median),
        "single_high": float(high),
        "percentile": float(100 * (1 - ratio.share_below(1 - paper / 100))),
    }


def _ratio(gravity: _Calibrations, robot: _Calibrations, effect: str) -> Controlled:
    """Ratio of the sigma of an effect, robot-aided over gravity-based, of independent sessions.

    Calibrations are paired by their number.
    """
    n = min(gravity.statistics.converged, robot.statistics.converged)
    above, linear_above = robot.sigmas(effect)
    below, linear_below = gravity.sigmas(effect)
    ratio = above[:n] / below[:n]
    numerator, denominator = robot.control, gravity.control
    if numerator is None or denominator is None:
        return Controlled(Sample(ratio), n)
    linear = linear_above[:n] / linear_below[:n]

    def known(probabilities: Array) -> Array:
        return numerator.ratio_quantiles(denominator, effect, probabilities)

    apart = apart_by_quantile(ratio - linear, linear, known(EDGES))
    return Controlled(
        Sample(ratio), n, linear=Sample(linear), known=known(PROBABILITIES), apart=apart
    )

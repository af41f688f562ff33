"""How far the robot reduces the sds a posteriori of single calibrations, from their estimates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.shares import Z95
from accelstudy.study.cell import Cell
from accelstudy.study.estimate import MEAN, controlled
from accelstudy.study.known import KnownValues
from accelstudy.study.quantiles import controlled_quantiles, share_below
from accelstudy.study.replicates import Replicates
from accelstudy.study.statistics import calibrations as numbers_of

Array = NDArray[np.float64]
LEVELS = np.array([0.025, 0.05, 0.25, 0.5, 0.75, 0.95, 0.975])
COLUMNS = (
    *("scheme", "effect", "mean", "half", "single_low", "median", "single_high", "percentile"),
)
CENTRAL = (0, 3, 6)
"""The ends of the central 95 %, and the median."""


def reductions(
    calibrations: Iterable[tuple[Cell, Replicates]], papers: Mapping[str, float]
) -> pd.DataFrame:
    """Reductions, %, of the sd of some effects, robot-aided against gravity-based.

    Parameters
    ----------
    calibrations : cells with the model of the claims, and their replicates
    papers : the paper's number for each effect

    Returns
    -------
    DataFrame
        One row per scheme in which both calibrations have redundancy, and effect: `mean` with
        `half` of its 95 % interval; of single simulations `single_low`, `median` and `single_high`
        (the central 95 %) and `percentile`, the share below the paper's number.
    """
    sigmas: dict[tuple[str, str], _Sigmas] = {}
    for cell, replicates in calibrations:
        simulated = replicates.simulated
        if simulated.redundancy > 0 and simulated.converged.any():
            sigmas[cell.scheme, cell.approach] = _Sigmas.of(cell, replicates)
    rows = []
    for effect, paper in papers.items():
        for scheme in (name for name, approach in sigmas if approach == "gravity"):
            if (scheme, "robot") in sigmas:
                pair = sigmas[scheme, "gravity"], sigmas[scheme, "robot"]
                reduction = _reduction(*pair, effect, paper)
                rows.append({"scheme": scheme, "effect": effect, **reduction})
    return pd.DataFrame(rows, columns=list(COLUMNS))


class _Sigmas(NamedTuple):
    """Mean sigma a posteriori of each effect in each calibration of a cell.

    `own` is (c, e) in the calibrations that converged, `theory` (R, e) by linear theory.
    """

    effects: list[str]
    own: Array
    theory: Array | None
    known: KnownValues | None
    converged: NDArray[np.bool_]

    @classmethod
    def of(cls, cell: Cell, replicates: Replicates) -> _Sigmas:
        """Take those of a cell."""
        simulated, linear = replicates
        theory = None if linear is None else numbers_of(cell, linear)["effect_sigma"]
        known = None if cell.linear_theory is None else KnownValues(cell, cell.linear_theory)
        own = numbers_of(cell, simulated)["effect_sigma"]
        return cls(list(cell.uniform_effects), own, theory, known, simulated.converged)

    def mean(self, effect: int) -> tuple[float, float]:
        """Mean sigma of an effect with its standard error, SI."""
        known = np.nan if self.known is None else self.known.effect_sigma
        mean = controlled(MEAN, self.own, self.theory, known, self.converged)
        return float(mean.value[effect]), float(mean.error[effect])

    def paired(self, effect: int, n: int) -> tuple[Array, Array | None]:
        """Sigmas of an effect in the first n calibrations that converged, and by linear theory."""
        theory = None if self.theory is None else self.theory[self.converged][:n, effect]
        return self.own[:n, effect], theory


def _reduction(gravity: _Sigmas, robot: _Sigmas, effect: str, paper: float) -> dict[str, float]:
    """Columns of `reductions` for one scheme and effect.

    Sessions are independent; single calibrations are paired by their number.
    """
    at = gravity.effects.index(effect)
    (below, error_below), (above, error_above) = gravity.mean(at), robot.mean(at)
    mean, n = 100 * (1 - above / below), min(len(gravity.own), len(robot.own))
    (own_above, theory_above), (own_below, theory_below) = (
        robot.paired(at, n),
        gravity.paired(at, n),
    )
    ratio, theory, known = own_above / own_below, None, None
    if theory_above is not None and theory_below is not None:
        theory = theory_above / theory_below
    if robot.known is not None and gravity.known is not None:
        known = robot.known.effect_ratio_quantiles(gravity.known, at, LEVELS)
    quantiles = controlled_quantiles(LEVELS, ratio, theory, known)
    high, median, low = 100 * (1 - quantiles.value[[*CENTRAL]])
    return {
        "mean": mean,
        "half": Z95 * (100 - mean) * float(np.hypot(error_above / above, error_below / below)),
        "single_low": float(low),
        "median": float(median),
        "single_high": float(high),
        "percentile": float(100 * (1 - share_below(1 - paper / 100, ratio, quantiles))),
    }

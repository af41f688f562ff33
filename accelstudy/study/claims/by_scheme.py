"""What single simulations show in each scheme of positions, and where the paper's number lies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.study.cell import Cell
from accelstudy.study.claims.quantities import Evidence, mean_reduction, scale_pairs
from accelstudy.study.known import KnownValues
from accelstudy.study.quantiles import controlled_quantiles, share_below
from accelstudy.study.replicates import Replicates
from accelstudy.study.sensitivity import APPROACHES
from accelstudy.study.statistics import calibrations as numbers_of

Array = NDArray[np.float64]
Calibrations = tuple[Cell, Replicates]

LEVELS = np.array([0.025, 0.05, 0.25, 0.5, 0.75, 0.95, 0.975])
CENTRAL = (0, 3, 6)
"""The ends of the central 95 %, and the median."""


def scheme_table(
    evidence: Evidence,
    calibrations: Iterable[Calibrations],
    claims: Sequence[Mapping[str, Any]],
) -> pd.DataFrame:
    """Compare the paper's numbers with single simulations in each scheme.

    Parameters
    ----------
    evidence : Evidence, without this table
    calibrations : cells with the model of the claims, and their replicates
    claims : the section `by_scheme` of the claims

    Returns
    -------
    DataFrame
        One row per claim and scheme: the paper's number; the `mean` of single simulations, their
        `single_low`, `median` and `single_high` (the central 95 %), and the `percentile` of the
        paper's number among them. Correlations hardly change from run to run; theirs are the
        least, the median and the largest of the pairs of scales.
    """
    cells = {(cell.scheme, cell.approach): (cell, each) for cell, each in calibrations}
    rows = []
    for claim in claims:
        for scheme in evidence.schemes:
            row = {"claim": claim["claim"], "scheme": scheme, "paper": claim["paper"]}
            if "scales" in claim:
                pairs = scale_pairs(evidence, claim["scales"], scheme)
                rows.append({**row, "mean": pairs.mean(), **_ends(np.quantile(pairs, [0, 0.5, 1]))})
                continue
            gravity, robot = (cells[scheme, approach] for approach in APPROACHES)
            mean = mean_reduction(evidence, claim["effect"], scheme)["value"]
            if not np.isnan(mean):  # without redundancy there is no sd a posteriori
                single = _single_reductions(gravity, robot, claim["effect"], claim["paper"])
                rows.append({**row, "mean": mean, **single})
    return pd.DataFrame(rows)


def _ends(values: Iterable[float]) -> dict[str, float]:
    return dict(zip(("single_low", "median", "single_high"), map(float, values), strict=True))


def _single_reductions(
    gravity: Calibrations, robot: Calibrations, effect: str, paper: float
) -> dict[str, float]:
    """Reductions, %, of the sd of an effect in single simulations, which are paired by number."""
    pair = (robot, gravity)
    above, below = (_sigmas(cell, both.simulated, effect) for cell, both in pair)
    n, known = min(len(above), len(below)), None
    of_theory, of_other = (
        _sigmas(cell, both.linear, effect)[both.simulated.converged][:n] for cell, both in pair
    )
    theories = [KnownValues(cell, theory) for cell, _ in pair if (theory := cell.linear_theory)]
    if len(theories) == len(pair):
        known = theories[0].effect_ratio_quantiles(theories[1], effect, LEVELS)
    ratio, linear = above[:n] / below[:n], of_theory / of_other
    quantiles = controlled_quantiles(LEVELS, ratio, linear, known)
    high, median, low = 100 * (1 - quantiles.value[[*CENTRAL]])
    share = share_below(1 - paper / 100, ratio, quantiles)
    return {**_ends((low, median, high)), "percentile": float(100 * (1 - share))}


def _sigmas(cell: Cell, block: Block, effect: str) -> Array:
    """Mean sigma a posteriori of an effect in each calibration that converged, (c,)."""
    sigmas = numbers_of(cell, block)["sigma_posteriori"][:, cell.columns_of(effect)]
    return np.asarray(sigmas.mean(axis=1))

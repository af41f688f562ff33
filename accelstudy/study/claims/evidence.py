"""The evidence for the claims, from the files of a study."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.study.cells.cell import Cell
from accelstudy.study.claims.base import Evidence, schemes_with_both
from accelstudy.study.monte_carlo.distributions import EXACT, Distribution, Sample, kept_values
from accelstudy.study.monte_carlo.followed import EFFECT
from accelstudy.study.monte_carlo.kept import kept_sketches
from accelstudy.study.monte_carlo.sketch import Sketch
from accelstudy.study.monte_carlo.statistics import Statistics, read_statistics

Array = NDArray[np.float64]


class RatioOfSketches:
    """Ratio of two independent quantities that have sketches; within 0.2 %."""

    def __init__(self, above: Sketch, below: Sketch) -> None:
        self.above = above
        self.below, counts = below.occupied()
        self.weights = counts / counts.sum()
        above_values, _ = above.occupied()
        self.ends = (
            above_values.min() / self.below.max() / 2,
            above_values.max() / self.below.min() * 2,
        )

    def share_below(self, values: ArrayLike) -> Array:
        """Shares that are below given values."""
        limits = np.multiply.outer(np.asarray(values, dtype=float), self.below)
        return self.above.share_below(limits) @ self.weights

    def quantile(self, probabilities: ArrayLike) -> Array:
        """Quantiles."""
        from scipy import optimize  # slow to import, and studies that keep replicates do without

        return np.array(
            [
                optimize.brentq(lambda x, p=p: self.share_below(x) - p, *self.ends, rtol=1e-9)
                for p in np.atleast_1d(probabilities)
            ]
        )


def evidence_from(
    cells: Iterable[Cell], parts: Mapping[str, Sequence[str | Path]], **rest: Any
) -> Evidence:
    """Collect the evidence.

    Parameters
    ----------
    cells : cells with the model of the claims
    parts : paths of `moments`, `sketches` and, where they are kept, `estimates` of these cells
    **rest : as in `Evidence`
    """
    by_name = {cell.name: cell for cell in cells}
    found = read_statistics(parts["moments"], by_name.values())
    by_key = {(by_name[name].scheme, by_name[name].approach): by_name[name] for name in found}
    statistics = {key: found[cell.name][0] for key, cell in by_key.items()}
    ratios: dict[tuple[str, str], Distribution] = {}
    for scheme in schemes_with_both(by_key):
        pair = [(by_key[scheme, a], statistics[scheme, a]) for a in ("gravity", "robot")]
        if all(its.moments.redundancy > 0 and its.converged for _, its in pair):
            for effect, ratio in _ratios(pair, parts).items():
                ratios[scheme, effect] = ratio
    return Evidence(statistics=statistics, ratios=ratios, cells=by_key, **rest)


def _ratios(
    pair: Sequence[tuple[Cell, Statistics]], parts: Mapping[str, Sequence[str | Path]]
) -> dict[str, Distribution]:
    """Ratios by effect, robot-aided over gravity-based, of independent sessions.

    Kept calibrations are paired by their number; with sketches, each is paired with each.
    """
    keys = [(EFFECT, effect) for effect in pair[0][1].followed.effects]
    if parts.get("estimates") and all(its.converged <= EXACT for _, its in pair):
        gravity, robot = (
            kept_values(parts["estimates"], cell, its.converged, keys) for cell, its in pair
        )
        n = min(gravity.shape[1], robot.shape[1])
        values = robot[:, :n] / gravity[:, :n]
        return {effect: Sample(row) for (_, effect), row in zip(keys, values, strict=True)}
    gravity_sketches, robot_sketches = (kept_sketches(parts["sketches"], cell) for cell, _ in pair)
    return {key[1]: RatioOfSketches(robot_sketches[key], gravity_sketches[key]) for key in keys}

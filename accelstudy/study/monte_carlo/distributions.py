"""Distributions over the calibrations of a cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from accelstudy.leveling.error import TiltError
from accelstudy.study.cell import Cell
from accelstudy.study.monte_carlo.control import Control
from accelstudy.study.monte_carlo.followed import Distributed, Followed, Key, cell_tilt_error
from accelstudy.study.monte_carlo.replicates import Replicates, simulate
from accelstudy.study.monte_carlo.statistics import LEAST, Estimates, Statistics

Array = NDArray[np.float64]

LOWER = (1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.025, 0.05, 0.25)
PROBABILITIES = np.array([*LOWER, 0.5, *(1 - p for p in reversed(LOWER))])
"""Probabilities of the quantiles of a study."""
_NORMAL = special.ndtri(PROBABILITIES)
EDGES = special.ndtr((_NORMAL[1:] + _NORMAL[:-1]) / 2)
"""Probabilities between them."""
MEAN_OF_NORMAL = float(np.sqrt(2 / np.pi))
"""Mean absolute value of a standard normal variable."""
ENOUGH = 10
"""Differences from which an sd is taken."""


def apart_by_quantile(differences: Array, expected: Array, edges: Array) -> Array:
    """Sums of differences from linear theory, (3, b), by its quantiles; see `Controlled.apart`.

    differences, expected : (R,), a quantity minus that of linear theory, and the latter
    edges : (b − 1,), quantiles of linear theory at `EDGES`; NaN where they are not known
    """
    if not np.isfinite(edges).all():
        return np.zeros((3, len(edges) + 1))
    place = np.searchsorted(edges, expected)
    powers = np.ones(len(place)), differences, differences**2
    return np.stack([np.bincount(place, each, len(edges) + 1) for each in powers])


class Sample:
    """All values, (R,), which are sorted once for all quantiles."""

    def __init__(self, values: Array) -> None:
        self.values = np.sort(values)

    def quantile(self, probabilities: ArrayLike) -> Array:
        """Quantiles."""
        last = len(self.values) - 1
        rank = np.asarray(probabilities, dtype=float) * last
        below = rank.astype(int)
        low, high = self.values[below], self.values[np.minimum(below + 1, last)]
        return np.asarray(low + (rank - below) * (high - low))

    def share_below(self, values: ArrayLike) -> Array:
        """Shares that are below given values."""
        return np.asarray(np.searchsorted(self.values, values) / len(self.values))


@dataclass(frozen=True)
class Controlled:
    """A distribution whose quantiles are corrected by those of linear theory.

    The quantile of the same replicates by linear theory is off its known value by nearly as much
    as that of the replicates themselves (Hesterberg & Nelson 1998, Management Science 44, 1295).

    Parameters
    ----------
    plain : Sample, of the converged calibrations
    count, failed : int, number of the converged calibrations, and of the others
    levels : (k,) array, probabilities of the quantiles, in order
    linear : Sample or None, of all replicates by linear theory
    known : (k,) array, its quantiles at the levels; NaN where they are not known
    apart : (3, b) array
        The number of converged replicates, Σ d and Σ d² of their differences d from linear theory,
        by the quantile of linear theory next to them.
    inexact : (k,) array, relative errors of `known`
    """

    plain: Sample
    count: int
    failed: int = 0
    levels: Array = field(default_factory=lambda: PROBABILITIES)
    linear: Sample | None = None
    known: Array | None = None
    apart: Array | None = None
    inexact: Array | None = None

    def quantile(self, chosen: NDArray[np.int_]) -> Estimates:
        """Quantiles at some of the levels, by their number."""
        p = self.levels[chosen]
        wide = np.minimum(p, 1 - p) / 2
        plain, low, high = self.plain.quantile([p, p - wide, p + wide])
        slope = (high - low) / (2 * wide)
        # Too few values have no density: their error is unknown.
        few = self.count < LEAST
        variance = p * (1 - p) / self.count * (np.nan if few else slope**2)
        known = np.full(len(p), np.nan) if self.known is None else self.known[chosen]
        if few or self.linear is None or self.apart is None or not np.isfinite(known).all():
            return Estimates(plain, np.sqrt(variance), np.ones(len(p)), plain)
        linear, low, high = self.linear.quantile([p, p - wide, p + wide])
        sd = np.array([self._sd_apart(each) for each in p])
        with np.errstate(divide="ignore", invalid="ignore"):
            # Share of the replicates that only one of the two has below its quantile.
            apart = MEAN_OF_NORMAL * sd / slope + self.failed / (self.count + self.failed)
            agreement = np.nan_to_num(np.clip(1 - apart / (2 * p * (1 - p)), 0.0, 1.0))
            scale = np.where(agreement > 0, slope * 2 * wide / (high - low), 0.0)
            corrected = plain - agreement * scale * (linear - known)
            left = variance * (1 - agreement**2)
            if not self.failed:  # no more than the difference of one replicate
                left = np.minimum(left, sd**2)
            if self.inexact is not None:
                left = left + (self.inexact[chosen] * known * agreement * scale) ** 2
            better = left < variance
            left = np.where(better, left, variance)
            value = np.where(better, corrected, plain)
            return Estimates(value, np.sqrt(left), variance / left, plain)

    def at(self, probability: float) -> Estimates:
        """Quantile at one level."""
        return self.quantile(np.flatnonzero(np.isclose(self.levels, probability)))[0]

    def share_below(self, values: ArrayLike) -> Array:
        """Shares that are below given values, corrected like the quantiles next to them."""
        seen = np.flatnonzero(np.minimum(self.levels, 1 - self.levels) * self.count >= 1)
        estimates = self.quantile(seen)
        shift = estimates.value - estimates.plain
        at = np.asarray(values, dtype=float)
        return self.plain.share_below(at - np.interp(at, estimates.value, shift))

    def _sd_apart(self, probability: float) -> float:
        """Sd of the differences from linear theory near a quantile."""
        assert self.apart is not None
        place = int(np.searchsorted(EDGES, probability))
        n, total, square = 0.0, 0.0, 0.0
        for wider in range(len(EDGES) + 1):
            n, total, square = self.apart[:, max(place - wider, 0) : place + wider + 1].sum(axis=1)
            if n >= min(ENOUGH, self.count):
                break
        return float(np.sqrt(max(square - total**2 / n, 0.0) / (n - 1))) if n > 1 else np.inf


def distributions(
    cell: Cell,
    replicates: Replicates,
    control: Control | None,
    tilt: TiltError,
    levels: Array = PROBABILITIES,
) -> dict[Key, Controlled]:
    """Distributions of the quantities of a cell, and of the tilt error.

    Parameters
    ----------
    cell : Cell
    replicates : Replicates
    control : Control or None
    tilt : TiltError, of the calibrations of the cell
    levels : probabilities of the quantiles

    Returns
    -------
    dict of Controlled; empty if no calibration converged
    """
    simulated, linear = replicates
    converged = simulated.converged
    count, failed = int(converged.sum()), int((~converged).sum())
    if not count:
        return {}
    distributed = Distributed(Followed.of(cell), simulated.redundancy, tilt)
    own = distributed.of(simulated)
    samples = map(Sample, own.T)
    if control is None or linear is None or len(converged) < LEAST:
        pairs = zip(distributed.keys, samples, strict=True)
        return {key: Controlled(each, count, failed, levels) for key, each in pairs}
    theory = distributed.of(linear)
    differences, expected = own - theory[converged], theory[converged]
    edges = control.quantiles(EDGES, exact=False)
    known, inexact = control.quantiles(levels), control.inexact(levels)
    return {
        key: Controlled(
            sample,
            count,
            failed,
            levels,
            Sample(theory[:, i]),
            known[i],
            apart_by_quantile(differences[:, i], expected[:, i], edges[i]),
            inexact[i],
        )
        for i, (key, sample) in enumerate(zip(distributed.keys, samples, strict=True))
    }


def simulated_cell(
    cell: Cell, seed: int, leveling: Mapping[str, Any], levels: Array = PROBABILITIES
) -> tuple[Statistics, dict[Key, Controlled], Replicates]:
    """Simulate a cell.

    Parameters
    ----------
    cell : Cell, estimable
    seed : int, of the study
    leveling : mapping with max_tilt_gon and attitudes
    levels : probabilities of the quantiles

    Returns
    -------
    statistics : Statistics
    distributions : dict of Controlled; empty if no calibration converged
    replicates : Replicates
    """
    tilt = cell_tilt_error(cell, leveling)
    control = Control.of(cell, tilt)
    replicates = simulate(cell, seed, control)
    statistics = Statistics.of(cell, replicates, control, tilt)
    return statistics, distributions(cell, replicates, control, tilt, levels), replicates

"""Distributions over the calibrations of a cell: exact where they are kept, else from sketches.

Files are read cell by cell, one row group at a time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.files.parquet import whole_parquet
from accelstudy.files.tables import REMEDY
from accelstudy.study.cell import Cell
from accelstudy.study.monte_carlo.control import Control
from accelstudy.study.monte_carlo.followed import LINEAR, Distributed, cell_tilt_error
from accelstudy.study.monte_carlo.moments import EDGES, PROBABILITIES, Node, Tree
from accelstudy.study.monte_carlo.replicates import Pair, chunks
from accelstudy.study.monte_carlo.sketch import (
    RELATIVE_ERROR,
    Key,
    Sketch,
    merged_sketches,
)
from accelstudy.study.monte_carlo.statistics import LEAST, Estimates, Statistics
from accelstudy.study.monte_carlo.summing import CellSketches, Summed

Array = NDArray[np.float64]

EXACT = 1_000_000
"""Kept calibrations of a cell up to which quantiles are exact. Beyond, they come from sketches. The
error of these is negligible against that of the simulation itself."""
MEAN_OF_NORMAL = float(np.sqrt(2 / np.pi))
"""Mean absolute value of a standard normal variable."""
ENOUGH = 10
"""Differences from which an sd is taken."""


class Distribution(Protocol):
    """A distribution, with quantiles."""

    def quantile(self, probabilities: ArrayLike) -> Array:
        """Quantiles, as `numpy.quantile` defines them."""

    def share_below(self, values: ArrayLike) -> Array:
        """Shares that are below given values."""


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
    plain : Distribution, of the converged calibrations
    count, failed : int, number of the converged calibrations, and of the others
    levels : (k,) array, probabilities of the quantiles, in order
    linear : Distribution or None, of all replicates by linear theory
    known : (k,) array, its quantiles at the levels; NaN where they are not known
    apart : (3, b) array, see `Moments.apart`
    inexact : (k,) array, relative errors of `known`
    """

    plain: Distribution
    count: int
    failed: int = 0
    levels: Array = field(default_factory=lambda: PROBABILITIES)
    linear: Distribution | None = None
    known: Array | None = None
    apart: Array | None = None
    inexact: Array | None = None

    @property
    def relative_error(self) -> float:
        """Bound of the relative error of quantiles by the buckets of sketches."""
        return RELATIVE_ERROR if isinstance(self.plain, Sketch) else 0.0

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


def cell_distributions(
    parts: Mapping[str, Sequence[str | Path]],
    statistics: Statistics,
    distributed: Distributed,
    control: Control | None,
    cell: Cell,
) -> dict[Key, Controlled]:
    """Distributions of the quantities of a cell, and of the tilt error.

    Parameters
    ----------
    parts : paths of `estimates` or, where they are not kept, of `sketches`
    statistics : Statistics, with at least one calibration
    distributed : Distributed, the quantities
    control : Control or None
    cell : Cell
    """
    if "estimates" in parts and statistics.converged <= EXACT:
        samples = _samples(kept_pairs(parts["estimates"], cell, control), distributed)
        return _controlled(*samples, statistics, distributed, control)
    if "estimates" in parts:
        counted = CellSketches(distributed)
        for pair in kept_pairs(parts["estimates"], cell, control):
            counted.add(pair)
        sketches = counted.by_key
    else:
        sketches = kept_sketches(parts["sketches"], cell)
    plain = {key: sketches[key] for key in distributed.keys}
    linear = {key: sketches.get((LINEAR + key[0], key[1])) for key in plain}
    return _controlled(plain, linear, statistics, distributed, control)


def simulated_distributions(
    cell: Cell, seed: int, leveling: Mapping[str, Any], levels: Array = PROBABILITIES
) -> tuple[Statistics, dict[Key, Controlled]]:
    """Return what `simulated_cell` does, without the replicates."""
    return simulated_cell(cell, seed, leveling, levels)[:2]


def simulated_cell(
    cell: Cell, seed: int, leveling: Mapping[str, Any], levels: Array = PROBABILITIES
) -> tuple[Statistics, dict[Key, Controlled], Block]:
    """Simulate a cell in memory.

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
    replicates : Block, all of them
    """
    tilt = cell_tilt_error(cell, leveling)
    control = Control.of(cell, tilt)
    centre, drawn = chunks(cell, seed, 0, cell.n_chunks, control)
    summed, tree, pairs = Summed(cell, control, tilt, centre), Tree(), []
    for index, pair in drawn:
        pairs.append(pair)
        tree.add(Node(index, 1, summed.moments(pair)))
    statistics = Statistics.of(cell, tree, control, tilt)
    replicates = Block.joined(pair.simulated for pair in pairs)
    if not statistics.converged:
        return statistics, {}, replicates
    samples = _samples(pairs, summed.distributed)
    found = _controlled(*samples, statistics, summed.distributed, control, levels)
    return statistics, found, replicates


def _samples(
    pairs: Iterable[Pair], distributed: Distributed
) -> tuple[dict[Key, Sample], dict[Key, Sample | None]]:
    """Values of the calibrations, and of linear theory."""
    own, theory = [], []
    for simulated, linear in pairs:
        own.append(distributed.of(simulated))
        if linear is not None:
            theory.append(distributed.of(linear))
    keys = distributed.keys
    plain = dict(zip(keys, map(Sample, np.concatenate(own).T), strict=True))
    if not theory:
        return plain, dict.fromkeys(keys)
    return plain, dict(zip(keys, map(Sample, np.concatenate(theory).T), strict=True))


def _controlled(
    plain: Mapping[Key, Distribution],
    linear: Mapping[Key, Distribution | None],
    statistics: Statistics,
    distributed: Distributed,
    control: Control | None,
    levels: Array = PROBABILITIES,
) -> dict[Key, Controlled]:
    moments = statistics.moments
    count, failed = moments.converged, moments.simulated - moments.converged
    if control is None or moments.simulated < LEAST:
        return {key: Controlled(plain[key], count, failed, levels) for key in distributed.keys}
    known, inexact = control.quantiles(levels), control.inexact(levels)
    return {
        key: Controlled(
            plain[key],
            count,
            failed,
            levels,
            linear[key],
            known[i],
            moments.apart[:, i],
            inexact[i],
        )
        for i, key in enumerate(distributed.keys)
    }


def plain_sketches(distributions: Mapping[Key, Controlled]) -> dict[Key, Sketch]:
    """Sketches of the calibrations and of linear theory, where distributions come from such."""
    plain = {key: each.plain for key, each in distributions.items()}
    linear = {(LINEAR + key[0], key[1]): each.linear for key, each in distributions.items()}
    return {key: each for key, each in (plain | linear).items() if isinstance(each, Sketch)}


def kept_pairs(
    paths: Iterable[str | Path], cell: Cell, control: Control | None = None
) -> Iterator[Pair]:
    """Kept replicates of a cell, chunk by chunk.

    Parameters
    ----------
    paths : files of estimates, in order; they may hold other cells too
    cell : Cell
    control : Control, optional

    Returns
    -------
    iterator of Pair, whose `correlation_sum`, which is not kept, is NaN

    Raises
    ------
    InputError
        If a file is missing or damaged.
    """
    u = len(cell.parameter_units)
    columns = ["estimate", "sigma_priori", "omega", "redundancy", "iterations", "converged"]
    by_theory = [] if control is None else ["linear_estimate", "linear_omega"]
    for rows in _row_groups(paths, cell.name, [*columns, *by_theory]):
        each = {name: rows[name].to_numpy() for name in (*columns, *by_theory)}
        block = Block(
            estimates=each["estimate"].reshape(-1, u),
            sigma_priori=each["sigma_priori"].reshape(-1, u),
            omega=each["omega"][::u],
            redundancy=int(each["redundancy"][0]),
            iterations=each["iterations"][::u],
            converged=each["converged"][::u],
            correlation_sum=np.full((u, u), np.nan),
        )
        linear = None
        if control is not None:
            estimates = each["linear_estimate"].reshape(-1, u)
            linear = control.kept(estimates, each["linear_omega"][::u])
        yield Pair(block, linear)


def kept_sketches(paths: Iterable[str | Path], cell: Cell) -> dict[Key, Sketch]:
    """Sketches of a cell, merged from files of its parts; errors as in `kept_pairs`."""
    return merged_sketches(_row_groups(paths, cell.name, ["quantity", "name", "bucket", "count"]))


def _row_groups(
    paths: Iterable[str | Path], cell: str, columns: Sequence[str]
) -> Iterator[pa.Table]:
    """Row groups of a cell; each row group holds one cell."""
    for path in paths:
        with whole_parquet(path, REMEDY) as file:
            for number in range(file.num_row_groups):
                if _cell_of(file, number) == cell:
                    yield file.read_row_group(number, list(columns))


def _cell_of(file: pq.ParquetFile, number: int) -> str:
    statistics = file.metadata.row_group(number).column(0).statistics
    if statistics is not None and statistics.has_min_max:
        return str(statistics.min)
    return str(file.read_row_group(number, ["cell"])["cell"][0])  # a name too long for statistics

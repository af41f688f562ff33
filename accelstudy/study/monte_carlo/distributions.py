"""Distributions over the calibrations of a cell: exact where they are kept, else from sketches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.leveling.error import TiltError
from accelstudy.study.cells.cell import Cell
from accelstudy.study.monte_carlo.followed import TILT, TILTS, CellSketches, Followed, tilts
from accelstudy.study.monte_carlo.kept import kept_blocks, kept_sketches
from accelstudy.study.monte_carlo.sketch import Key
from accelstudy.study.monte_carlo.statistics import Statistics

Array = NDArray[np.float64]

EXACT = 1_000_000
"""Kept calibrations of a cell up to which quantiles are exact. Beyond, they come from sketches. The
error of these is negligible against that of the simulation itself."""


class Distribution(Protocol):
    """A distribution, with quantiles."""

    def quantile(self, probabilities: ArrayLike) -> Array:
        """Quantiles, as `numpy.quantile` defines them."""

    def share_below(self, values: ArrayLike) -> Array:
        """Shares that are below given values."""


class Sample:
    """All values, (R,)."""

    def __init__(self, values: Array) -> None:
        self.values = values

    def quantile(self, probabilities: ArrayLike) -> Array:
        """Quantiles."""
        return np.quantile(self.values, np.asarray(probabilities, dtype=float))

    def share_below(self, values: ArrayLike) -> Array:
        """Shares that are below given values."""
        at = np.searchsorted(np.sort(self.values), values)
        return np.asarray(at / len(self.values))


def cell_distributions(
    cell: Cell, parts: Mapping[str, Sequence[str | Path]], statistics: Statistics, tilt: TiltError
) -> Mapping[Key, Distribution]:
    """Distributions of the quantities of a cell, and of the tilt error.

    Parameters
    ----------
    cell : Cell
    parts : paths of `estimates` or, where they are not kept, of `sketches`
    statistics : Statistics, with at least one calibration
    tilt : TiltError, about the mean of the kept calibrations
    """
    if "estimates" not in parts:
        return kept_sketches(parts["sketches"], cell)
    if statistics.converged > EXACT:
        sketches = CellSketches(statistics.followed, tilt)
        for block in kept_blocks(parts["estimates"], cell):
            sketches.add(block, statistics.followed.values(block))
        return sketches.found
    keys = statistics.followed.sketched(statistics.moments.redundancy)
    angles = [(TILT, name) for name in TILTS]
    values = kept_values(parts["estimates"], cell, statistics.converged, keys, tilt)
    return {key: Sample(column) for key, column in zip([*keys, *angles], values, strict=True)}


def kept_values(
    estimates: Sequence[str | Path],
    cell: Cell,
    count: int,
    keys: Sequence[Key],
    tilt: TiltError | None = None,
) -> Array:
    """Quantities of the kept calibrations of a cell that converged, (k, count), and tilt errors."""
    followed = Followed.of(cell)
    columns = [followed.keys.index(key) for key in keys]
    found = np.empty((len(keys) + (0 if tilt is None else len(TILTS)), count))
    end = 0
    for block in kept_blocks(estimates, cell):
        values = followed.values(block)
        start, end = end, end + len(values)
        found[: len(keys), start:end] = values[:, columns].T
        if tilt is not None:
            chosen = block.estimates[block.converged][:, : len(tilt.reference)]
            found[len(keys) :, start:end] = tilts(tilt, chosen)
    return found

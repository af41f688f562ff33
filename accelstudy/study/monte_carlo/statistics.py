"""Statistics of the calibrations of a cell, from all its chunks."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from accelstudy.files.parquet import read_parquet
from accelstudy.files.tables import REMEDY
from accelstudy.study.cell import Cell
from accelstudy.study.monte_carlo.followed import ERROR, Followed
from accelstudy.study.monte_carlo.moments import Moments, Tree, moments_of, read_nodes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Statistics:
    """The calibrations of a cell, summed up.

    Attributes
    ----------
    followed : Followed, the quantities
    moments : Moments, of all calibrations
    """

    followed: Followed
    moments: Moments

    @classmethod
    def of_none(cls, cell: Cell) -> Statistics:
        """Return the statistics of a cell that was not simulated."""
        followed = Followed.of(cell)
        q, u = len(followed.keys), len(followed.units)
        nothing = np.zeros(u, np.int64), np.zeros((u, u))
        return cls(followed, moments_of(np.zeros((0, q)), 0, 0, *nothing))

    @property
    def converged(self) -> int:
        """Number of calibrations that converged."""
        return self.moments.converged

    def mean(self, quantity: str) -> Array:
        """Mean of a quantity, one number per parameter or effect, SI; NaN without calibrations."""
        mean = self.moments.mean[self.followed.columns(quantity)]
        return mean if self.converged else np.full_like(mean, np.nan)

    def first(self, quantity: str) -> Array:
        """A quantity in the first calibration that converged, like `mean`."""
        return self.moments.first[self.followed.columns(quantity)]

    def covariance(self, quantity: str) -> Array:
        """Empirical covariances of a quantity; NaN for fewer than two calibrations."""
        columns = self.followed.columns(quantity)
        n = self.converged
        return self.moments.comoment[columns, columns] / (n - 1 if n > 1 else np.nan)

    def sd(self, quantity: str) -> Array:
        """Empirical standard deviation of a quantity, like `mean`."""
        return np.sqrt(np.diagonal(self.covariance(quantity)))

    def error_of_mean(self, quantity: str) -> Array:
        """Standard error of the mean of a quantity, like `mean`."""
        columns = self.followed.columns(quantity)
        return np.sqrt(np.diagonal(self.moments.comoment)[columns]) / (self.converged or np.nan)

    def correlations(self) -> tuple[Array, Array]:
        """Correlations of the parameters: mean of those from Σ_xx, and over the calibrations."""
        mean = self.moments.correlation_sum / (self.converged or np.nan)
        covariance = self.covariance(ERROR)
        if self.converged <= len(covariance):
            return mean, np.full_like(covariance, np.nan)
        sd = np.sqrt(np.diagonal(covariance))
        return mean, np.clip(covariance / sd[:, None] / sd, -1, 1)


def read_statistics(
    paths: Iterable[str | Path], cells: Iterable[Cell]
) -> dict[str, tuple[Statistics, Tree]]:
    """Merge the moments of cells from the files of their parts, in order; by name of the cell.

    Cells that were not simulated are not in it.
    """
    wanted = {cell.name: cell for cell in cells}
    trees: dict[str, Tree] = {}
    for path in paths:
        for name, node in read_nodes(read_parquet(path, REMEDY)):
            if name in wanted:
                trees.setdefault(name, Tree()).add(node)
    return {
        name: (Statistics(Followed.of(wanted[name]), tree.total), tree)
        for name, tree in trees.items()
    }

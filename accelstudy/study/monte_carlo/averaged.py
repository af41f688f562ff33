"""The numbers of every calibration of which a study takes means."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.leveling.error import TiltError
from accelstudy.study.monte_carlo.followed import EFFECT, ERROR, POSTERIORI, PRIORI, Followed

Array = NDArray[np.float64]

PRODUCT, CORRELATION = "product", "correlation"
FACTOR, INSIDE, SQUARE = "variance_factor", "inside", "tilt_squared"
"""Beside the quantities of `Followed`: products of two errors, on and below the diagonal; what they
say of the correlation, below it; σ̂0²; whether an interval holds the truth; and squared tilt errors.
Errors and their products are about a centre near the mean of the estimates."""


@dataclass(frozen=True)
class Averaged:
    """The numbers of the calibrations of a cell, in SI.

    Parameters
    ----------
    followed : Followed
    centre : (u,) array, near the mean of the estimates
    cofactors : (u, u) array, covariance of the estimates by linear theory
    tilt : TiltError; None if there are no calibrations
    """

    followed: Followed
    centre: Array
    cofactors: Array
    tilt: TiltError | None

    @cached_property
    def columns(self) -> dict[str, slice]:
        """Columns of each quantity."""
        u, effects = len(self.centre), len(self.followed.effects)
        sizes = {ERROR: u, PRODUCT: u * (u + 1) // 2, CORRELATION: u * (u - 1) // 2}
        sizes |= {PRIORI: u, POSTERIORI: u, EFFECT: effects, FACTOR: 1, INSIDE: u, SQUARE: 2}
        ends = pairwise([0, *accumulate(sizes.values())])
        return {name: slice(*end) for name, end in zip(sizes, ends, strict=True)}

    @property
    def count(self) -> int:
        """Number of columns."""
        return self.columns[SQUARE].stop

    def of(self, block: Block) -> Array:
        """Numbers of R calibrations, (R, k); 0 of those that did not converge."""
        assert self.tilt is not None
        converged = block.converged
        numbers = np.zeros((len(converged), self.count))
        values = self.followed.values(block)
        estimates = block.estimates[converged]
        errors = estimates - self.centre
        i, j = np.tril_indices(len(self.centre))
        products = errors[:, i] * errors[:, j]
        redundancy = block.redundancy
        factor = block.omega[converged, None] / (redundancy if redundancy > 0 else np.nan)
        numbers[converged] = np.hstack(
            [
                errors,
                products,
                self.influences(products),
                *(values[:, self.followed.columns(q)] for q in (PRIORI, POSTERIORI, EFFECT)),
                factor,
                self.followed.inside(values, redundancy),
                self.tilt.squares(estimates[:, : len(self.tilt.reference)]),
            ]
        )
        return numbers

    def influences(self, products: Array) -> Array:
        """Influence of a calibration on the correlation ρ, z_i z_j − ρ (z_i² + z_j²)/2.

        z are the errors over their standard deviations, i and j those below the diagonal.
        """
        u = len(self.centre)
        i, j = np.tril_indices(u)
        scale = np.sqrt(np.diagonal(self.cofactors))
        scaled = products / (scale[i] * scale[j])
        squares, below = scaled[:, i == j], i != j
        rho = (self.cofactors / np.outer(scale, scale))[i, j]
        halves = (squares[:, i[below]] + squares[:, j[below]]) / 2
        return np.asarray(scaled[:, below] - rho[below] * halves)

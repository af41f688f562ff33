"""What linear theory knows of the calibrations of a cell before any is simulated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from accelstudy.adjustment.calibration import Block
from accelstudy.adjustment.linear_theory import LinearTheory
from accelstudy.leveling.distribution import TiltDistribution
from accelstudy.leveling.error import TiltError
from accelstudy.simulation.sessions import Errors
from accelstudy.study.cell import Cell
from accelstudy.study.monte_carlo.averaged import (
    CORRELATION,
    FACTOR,
    INSIDE,
    PRODUCT,
    SQUARE,
    Averaged,
)
from accelstudy.study.monte_carlo.followed import (
    EFFECT,
    ERROR,
    POSTERIORI,
    PRIORI,
    TILTS,
    Distributed,
    Followed,
)

Array = NDArray[np.float64]

CENTRAL = 1e-6
"""Offsets below this share of a standard deviation, and an Ω below it, count as none."""


@dataclass(frozen=True)
class Control:
    """Linear theory of a cell.

    Parameters
    ----------
    theory : LinearTheory
    followed : Followed
    tilt : TiltError
    """

    theory: LinearTheory
    followed: Followed
    tilt: TiltError

    @classmethod
    def of(cls, cell: Cell, tilt: TiltError) -> Control | None:
        """Return the linear theory of a cell, or None if it has no calibration without noise."""
        theory = cell.linear_theory
        if theory is None:
            return None
        return cls(theory, Followed.of(cell), tilt)

    def block(self, errors: Errors, uses_angles: bool) -> Block:
        """Calibrations of R sessions with given errors, as linear theory has them."""
        observed = errors.force
        if uses_angles:
            assert errors.angle is not None
            observed = np.concatenate([observed, errors.angle], axis=-1)
        estimates, omega = self.theory.errors(observed, errors.gravity)
        return self.kept(self.theory.reference + estimates, omega)

    def kept(self, estimates: Array, omega: Array) -> Block:
        """Calibrations with given estimates (R, u) and Ω (R,)."""
        count, u = estimates.shape
        return Block(
            estimates=estimates,
            sigma_priori=np.broadcast_to(self.theory.sigma, (count, u)),
            omega=omega,
            redundancy=self.theory.redundancy,
            iterations=np.ones(count, int),
            converged=np.ones(count, bool),
            correlation_sum=np.full((u, u), np.nan),
        )

    def means(self, averaged: Averaged) -> Array:
        """Means of the numbers of `averaged`, (k,); NaN where linear theory does not know them."""
        theory, followed = self.theory, self.followed
        offset = theory.reference - averaged.centre
        second = theory.covariance + np.outer(offset, offset)
        products = second[np.tril_indices(len(offset))]
        root = self._mean_root if self._determines_factor else np.nan
        effects = [theory.sigma[at].mean() for at in followed.effects.values()]
        # The interval has its nominal share where the truth is in its middle.
        shift = np.abs(theory.reference - followed.truth) / theory.sigma
        central = (shift < CENTRAL) & (theory.misfit < CENTRAL) & self._determines_factor
        known: dict[str, ArrayLike] = {
            ERROR: offset,
            PRODUCT: products,
            CORRELATION: averaged.influences(products[None])[0],
            PRIORI: theory.sigma,
            POSTERIORI: root * theory.sigma,
            EFFECT: root * np.array(effects),
            FACTOR: 1 + theory.misfit / theory.redundancy if self._determines_factor else np.nan,
            INSIDE: np.where(central, 0.95, np.nan),
            SQUARE: self._tilts.mean_squares,
        }
        means = np.empty(averaged.count)
        for name, columns in averaged.columns.items():
            means[columns] = known[name]
        return means

    @cached_property
    def distributed(self) -> Distributed:
        """The quantities that have quantiles."""
        return Distributed(self.followed, self.theory.redundancy, self.tilt)

    def quantiles(self, probabilities: Array, exact: bool = True) -> Array:
        """Quantiles of the quantities of `distributed`, (s, k), SI; NaN where they are not known.

        Without `exact`, those of tilt errors are approximate.
        """
        theory, followed = self.theory, self.followed
        names, rows = list(followed.units), []
        root = np.full(len(probabilities), np.nan)
        if self._determines_factor:
            factor = special.chndtrix(probabilities, theory.redundancy, theory.misfit)
            root = np.sqrt(factor / theory.redundancy)
        for quantity, name in self.distributed.keys[: -len(TILTS)]:
            if quantity == ERROR:
                i = names.index(name)
                spread = np.sqrt(theory.covariance[i, i])
                middle = theory.reference[i] - followed.truth[i]
                rows.append(middle + spread * special.ndtri(probabilities))
            else:
                at = [names.index(name)] if quantity == POSTERIORI else followed.effects[name]
                rows.append(theory.sigma[at].mean() * root)
        tilts = self._tilts.quantile if exact else self._tilts.approximate_quantile
        return np.vstack([*rows, tilts(probabilities)])

    def inexact(self, probabilities: Array) -> Array:
        """Relative errors of `quantiles` by how they are computed, (s, k)."""
        tilts = self._tilts.relative_error(probabilities)
        exact = len(self.distributed.keys) - len(TILTS)
        return np.vstack([np.zeros((exact, len(probabilities))), tilts])

    def ratio_quantiles(self, other: Control, effect: str, probabilities: Array) -> Array:
        """Quantiles of the sigma of an effect over that of another, independent cell, (k,)."""
        if not (self._determines_factor and other._determines_factor):
            return np.full(len(probabilities), np.nan)
        if max(self.theory.misfit, other.theory.misfit) > CENTRAL:
            return np.full(len(probabilities), np.nan)
        sigmas = [each.theory.sigma[each.followed.effects[effect]].mean() for each in (self, other)]
        freedom = self.theory.redundancy, other.theory.redundancy
        return sigmas[0] / sigmas[1] * np.sqrt(special.fdtri(*freedom, probabilities))

    @cached_property
    def _tilts(self) -> TiltDistribution:
        u = len(self.tilt.reference)
        return TiltDistribution(self.tilt, self.theory.covariance[:u, :u])

    @property
    def _determines_factor(self) -> bool:
        """Whether the distribution of σ̂0² is known."""
        return self.theory.chi_squared and self.theory.redundancy > 0

    @property
    def _mean_root(self) -> float:
        """Mean of σ̂0, the root of a (noncentral) χ² over its degrees of freedom."""
        r, offset = self.theory.redundancy, self.theory.misfit
        ratio = np.exp(special.gammaln((r + 1) / 2) - special.gammaln(r / 2))
        return float(np.sqrt(2 / r) * ratio * special.hyp1f1(-0.5, r / 2, -offset / 2))

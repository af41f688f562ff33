"""How well fits to some positions predict the others, with and without a named effect.

Base model and extended model are fitted to some positions and predict the others. With r the
misclosures of unit weight that the base model leaves there, A₂ their derivatives, C the cofactors
of the base parameters and d = r − r' the correction that the extended model makes,

    z = dᵀr / √(dᵀ (I + A₂ C A₂ᵀ) d)

is standard normal if the base model is complete, whatever effect was chosen on the fitted
positions. `held_out_gap` does this by rigorous fits, `LinearSplit` to first order, for many
residuals at once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment import Observations
from accelstudy.adjustment.quality import Solution
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.effects import HoldConditions

Array = NDArray[np.float64]


Group: TypeAlias = tuple[Any, Array, float]
"""Some of several residuals, columns (m, l) that l parameters show in all positions, and the
information that there is on each of them before."""


@dataclass(frozen=True)
class HeldOutGap:
    """Evidence from held-out positions, in units of the noise variance.

    Attributes
    ----------
    before, after : float, mean square of the misclosures of the base and of the extended model
    floor : float, what it would be with the right model
    z : float
    held : tuple of int, indices of the held-out positions
    needed : float, z beyond which the correction is right at 5 %, given that it has a name
    short : float, by how much less than expected the residuals agree with the correction, negative,
        over its sigma: about standard normal if the extended model is right
    """

    before: float
    after: float
    floor: float
    z: float
    held: tuple[int, ...]
    needed: float = RULES.z_significant
    short: float = 0.0

    @property
    def significant(self) -> bool:
        """Whether the correction is right at 5 %."""
        return self.z > self.needed

    @property
    def refutes(self) -> bool:
        """Whether the residuals do not shrink, and would have to if the model were right."""
        return self.after >= self.before and self.short < -RULES.z_refuted


def split_positions(
    forces: Array, hold: HoldConditions, count: int, rng: np.random.Generator
) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Split positions into fitted and held-out ones, alike in direction, time and temperature.

    Of many random splits the one is taken whose two parts agree best in the first and second
    moments. It depends on where and when was measured, never on the readings.

    Parameters
    ----------
    forces : (n, 3) array, of an ideal sensor
    hold : HoldConditions
    count : int, positions to hold out
    rng : Generator
    """
    n = len(forces)
    unit = forces / np.linalg.norm(forces, axis=1, keepdims=True)
    columns = [*unit.T, *(unit[:, i] * unit[:, j] for i in range(3) for j in range(i + 1))]
    for values in (hold.time, hold.temperature, hold.vibration):
        if values is not None and np.ptp(values) > 0:
            scaled = (values - np.mean(values)) / np.std(values)
            columns += [scaled, scaled**2]
    features = np.column_stack(columns)
    scale = features.std(axis=0)
    features = (features - features.mean(axis=0)) / np.where(scale > 0, scale, 1.0)
    best, least = np.arange(n), np.inf
    for _ in range(RULES.splits):
        order = rng.permutation(n)
        # The means of the two parts differ in proportion to the sum over either.
        imbalance = float(np.sum(features[order[:count]].sum(axis=0) ** 2))
        if imbalance < least:
            best, least = order, imbalance
    return np.sort(best[count:]), np.sort(best[:count])


def held_out_gap(
    base: Solution,
    extended: Solution,
    rest: Observations,
    held: NDArray[np.int_],
    variance: float | None,
) -> HeldOutGap:
    """Predict positions by fits of two models to others.

    Parameters
    ----------
    base, extended : Solution, of the same positions
    rest : Observations, of the others
    held : indices of the others, for the record
    variance : float, of unit weight; None takes that of the base fit
    """
    if variance is None:
        variance = base.omega / base.redundancy
    first, second = (_predict(solution, rest) for solution in (base, extended))
    d = first.white - second.white
    slope = d @ first.slope
    size = float(d @ d + slope @ base.cofactors @ slope)
    before, after = (float(np.mean(p.white**2)) / variance for p in (first, second))
    cofactors = extended.cofactors / relative_variance(extended, base)
    spread, usual = (
        float(np.einsum("mu,uv,mv->", p.slope, q, p.slope))
        for p, q in ((second, cofactors), (first, base.cofactors))
    )
    along = d @ second.slope
    missed = float(d @ second.white)
    if not extended.model.prior_weights.any():
        # The noise of its size makes a correction too large on average, and misses by it. With a
        # prior it is as much smaller.
        missed += (spread - usual) * variance
    noise = float(d @ d + along @ cofactors @ along) * variance
    return HeldOutGap(
        before=before,
        after=after,
        floor=float(1 + spread / len(d)),
        z=float(d @ first.white / np.sqrt(size * variance)) if size > 0 else 0.0,
        held=tuple(int(i) for i in held),
        short=float(missed / np.sqrt(noise)) if noise > 0 else 0.0,
    )


def relative_variance(one: Solution, other: Solution) -> float:
    """Ratio of the variances of unit weight of two fits that take different sigmas."""
    taken = [float(np.mean(np.asarray(fit.observed.sigma_force))) for fit in (one, other)]
    return (taken[0] / taken[1]) ** 2


class _Prediction(NamedTuple):
    """Misclosures of unit weight in unused positions, (m,), and their derivatives, (m, u)."""

    white: Array
    slope: Array


def _predict(fit: Solution, observed: Observations) -> _Prediction:
    """Predict positions by a fit to others."""
    at = Residuals.at(fit.model, fit.approach, observed, fit.parameters)
    rows = at.whitening.shape[0] * at.whitening.shape[1]
    return _Prediction(at.errors[:rows], at.design[:rows])


@dataclass(frozen=True)
class LinearSplit:
    """Positions of one fit, in two parts.

    Attributes
    ----------
    frame : SessionFit, of all positions
    fitted, held : (f,) and (h,) int arrays
    """

    frame: SessionFit
    fitted: NDArray[np.int_]
    held: NDArray[np.int_]

    @cached_property
    def rows(self) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
        """Rows of the conditions of either part; observed gravity is with the fitted one."""
        n, c = self.frame.residuals.whitening.shape[:2]
        fitted, held = (
            (part[:, None] * c + np.arange(c)).ravel() for part in (self.fitted, self.held)
        )
        last = np.arange(n * c, len(self.frame.residuals.design))
        return np.concatenate([fitted, last]), held

    @cached_property
    def designs(self) -> tuple[Array, Array]:
        """Ã of either part."""
        design = self.frame.residuals.design
        return design[self.rows[0]], design[self.rows[1]]

    @cached_property
    def cofactors(self) -> Array:
        """Cofactors of the parameters by the fitted part, (u, u)."""
        a = self.designs[0]
        return np.asarray(np.linalg.inv(a.T @ a), dtype=float)

    def base_residuals(self, errors: Array) -> tuple[Array, Array]:
        """What the base model leaves of the fitted part, and of the held-out part it predicts.

        Parameters
        ----------
        errors : (b, m) array, of all positions
        """
        a, b = self.designs
        estimates = errors[:, self.rows[0]] @ a @ self.cofactors
        return (
            errors[:, self.rows[0]] - estimates @ a.T,
            errors[:, self.rows[1]] - estimates @ b.T,
        )

    def residuals(self, part: Residuals, errors: Array) -> Array:
        """Residuals of the fit to the fitted part, (b, ...).

        Parameters
        ----------
        part : Residuals, of the fitted part
        errors : (b, m) array, of all positions
        """
        return part.project(errors[:, self.rows[0]].T).T

    def statistic(self, change: Array, errors: Array, known: bool) -> Array:
        """Z of corrections (b, h c) of the held-out part, (b,), for errors (b, m).

        The noise is known, or that of what is left of the fitted part. Z is 0 where a correction
        does not show, and so says nothing.
        """
        left, missed = self.base_residuals(errors)
        variance = np.ones(len(left))
        if not known:
            variance = np.sum(left**2, axis=1) / (left.shape[1] - len(self.cofactors))
        slope = change @ self.designs[1]
        size = np.sum(change**2, axis=1) + np.sum((slope @ self.cofactors) * slope, axis=1)
        scale = np.sqrt(size * variance)
        return np.asarray(np.sum(change * missed, axis=1) / np.where(scale > 0, scale, np.inf))

    def corrections(self, errors: Array, groups: Iterable[Group]) -> Array:
        """Corrections of the held-out part, (b, h c), by what the fitted part shows of errors.

        Parameters
        ----------
        errors : (b, m) array, of all positions
        groups : Groups, of some of these each
        """
        left, rows = self.base_residuals(errors)[0], self.rows[1]
        change = np.zeros((len(errors), len(rows)))
        for some, columns, prior in groups:
            fitted, rest = self.base_residuals(columns.T)
            if prior:
                inner = fitted @ fitted.T + prior * np.eye(len(fitted))
                fit = fitted.T @ np.linalg.inv(inner)
            else:
                fit = np.linalg.pinv(fitted)
            change[some] = left[some] @ fit @ rest
        return change

"""A recursive Gauss–Helmert adjustment that takes one position at a time.

A new position costs an update of a triangle, whatever the number of positions so far. That is exact
where the conditions are linear. Where the estimate moves, the earlier positions are linearised at
the wrong point. The last time that all were linearised anew shows how much that matters: a movement
of so many standard deviations left an error of so many. As soon as the predicted error exceeds a
tolerance, all are linearised anew. By default the tolerance is so small that the result is that of
the adjustment of all positions together. With a coarser tolerance, still far below a standard
deviation, most positions need no pass over the others.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.adjustment import Observations
from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.adjustment.gauss_helmert import MAX_ITERATIONS, ROUNDING, Whitened, whitened
from accelstudy.approaches import Approach
from accelstudy.design.estimability import rank_of
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sequential.information import (
    NOTHING_KNOWN,
    Prior,
    absorb,
    inverse_root,
    length,
    no_information,
    solution,
)

Array = NDArray[np.float64]

EXACT = 1e-10
"""Default tolerance in standard deviations; the adjustment of all positions is no more exact."""
_ARRAYS = tuple(field.name for field in fields(Whitened))
_SESSIONS = -2
"""Axis of the sessions in the arrays of `Whitened`; the last axis is that of the positions."""
_OF_SESSIONS = ("solved", "passes", "_bent", "_rate", "_x", "_at", "_mean", "_start")
"""Arrays that begin with the sessions, and change in place when a position is taken."""


@dataclass(frozen=True)
class Prediction:
    """Prediction of the next position from those so far, R sessions.

    Attributes
    ----------
    misclosures : (R, c) array, of unit weight
    covariance : (R, c, c) array, a priori, of the next position and the prediction together
    """

    misclosures: Array
    covariance: Array

    @property
    def statistic(self) -> Array:
        """Squared misclosures over their covariance, (R,): σ0² χ² with c degrees of freedom."""
        scaled = np.linalg.solve(self.covariance, self.misclosures[..., None])[..., 0]
        return np.asarray(np.sum(self.misclosures * scaled, axis=-1))

    def p_value(self, omega: Array | None = None, redundancy: int = 0) -> Array:
        """P-values of a position that is free of a gross error, (R,).

        Parameters
        ----------
        omega : (R,) array, optional
            Ω of the earlier positions, where the noise is estimated from them (an F test); by
            default the noise is known (a χ² test).
        redundancy : int, of the earlier positions; with 0 there is no test, and the p-value is NaN
        """
        c = self.misclosures.shape[-1]
        if omega is None:
            return np.asarray(special.chdtrc(c, self.statistic))
        if redundancy <= 0:
            return np.full(len(self.misclosures), np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.statistic / c / (omega / redundancy)
        return np.asarray(special.fdtrc(c, redundancy, ratio))


class Recursion:
    """R sessions of one set-up, calibrated position after position.

    Parameters
    ----------
    model : SensorModel
    approach : Approach
    observed : Observations
        The sessions so far; they may have no positions yet.
    prior : Prior, optional
        What is known before the first position.
    initial : (u,) array, SI, optional
        Where to linearise as long as there is no solution; the mean of the prior by default.
    tolerance : float
        Largest predicted difference, in standard deviations, from the solution of all positions
        together. By default there is none.

    Attributes
    ----------
    n_positions : int, that were taken
    solved : (R,) bool array, whether there is a solution
    passes : (R,) int array, how often all positions were linearised anew for the last one

    Raises
    ------
    InputError
        As `accelstudy.adjustment.calibrate`, where something is missing.
    """

    def __init__(
        self,
        model: SensorModel,
        approach: Approach,
        observed: Observations,
        prior: Prior = NOTHING_KNOWN,
        initial: Array | None = None,
        tolerance: float = EXACT,
    ) -> None:
        self.model, self.approach, self.tolerance = model, approach, tolerance
        self.n_positions = 0
        problem = CalibrationProblem.of(model, approach, observed.take(np.arange(0)))
        sessions, u = problem.initial.shape
        before, mean = prior.rows_of(model), prior.start(model)
        # Observed gravity, and 0 ± 1 of errors that angles share, are prior knowledge, too.
        gravity = np.flatnonzero(problem.weights)
        self._before = np.zeros((len(before) + len(gravity), u))
        self._before[: len(before), : model.n_parameters] = before
        self._before[len(before) :, gravity] = np.diag(np.sqrt(problem.weights[gravity]))
        self._mean, self._start = problem.initial.copy(), problem.initial.copy()
        self._mean[:, : model.n_parameters] = mean
        self._start[:, : model.n_parameters] = mean if initial is None else initial

        self.solved = np.zeros(sessions, dtype=bool)
        self.passes = np.zeros(sessions, dtype=int)
        self._x, self._at = self._start.copy(), self._start.copy()
        # All conditions are kept, so that residuals are known at any time, and some sessions can be
        # linearised anew while others stay. Those of a session refer to one point, x₀ in `_at`: at
        # unit weight they are Ã (x − x₀) + w̃.
        self._white = _no_conditions(approach.n_conditions, u, problem.observations.shape)
        self._latent = np.zeros((3, sessions, 0))
        self._triangles = absorb(no_information(sessions, u), self._prior_rows(np.arange(sessions)))
        self._n_rows = len(self._before)
        self._bent, self._rate = np.zeros(sessions), np.ones(sessions)
        self._solve_first(problem)
        self.add(observed)

    def add(self, observed: Observations) -> None:
        """Take the new positions of sessions, one after the other.

        Parameters
        ----------
        observed : Observations
            The sessions so far, including the positions that were taken before.
        """
        for n in range(self.n_positions + 1, observed.forces.shape[1] + 1):
            self._take(observed.take(np.arange(n)))

    def only(self, chosen: NDArray[np.int_]) -> Recursion:
        """Return some of the sessions, to continue with them alone."""
        part = copy(self)
        for name in _OF_SESSIONS:
            setattr(part, name, getattr(self, name)[chosen])
        part._triangles, part._latent = self._triangles[chosen], self._latent[:, chosen]
        part._white = _of_sessions(self._white, chosen)
        return part

    def predict(self, observed: Observations) -> Prediction:
        """Predict the misclosures of the next position.

        Parameters
        ----------
        observed : Observations
            The sessions with one more position than were taken; all sessions must be solved.
        """
        new, _ = self._newest(observed)
        design = np.moveaxis(new.design[..., 0], -1, 0)
        spread = design @ inverse_root(self._triangles)
        covariance = np.eye(design.shape[1]) + spread @ np.swapaxes(spread, 1, 2)
        return Prediction(np.moveaxis(new.misclosures[..., 0], -1, 0), covariance)

    @property
    def parameters(self) -> Array:
        """Estimates, (R, u'), SI; NaN where there is no solution."""
        return np.where(self.solved[:, None], self._x, np.nan)

    @property
    def root_information(self) -> Array:
        """R of the parameters, (R, u', u'), with Q_xx⁻¹ = RᵀR; also where there is no solution."""
        return self._triangles[:, :-1, :-1]

    @property
    def cofactors(self) -> Array:
        """Q_xx, (R, u', u'); NaN where there is no solution."""
        u = self._x.shape[1]
        result = np.full((len(self._x), u, u), np.nan)
        root = inverse_root(self._triangles[self.solved])
        result[self.solved] = root @ np.swapaxes(root, 1, 2)
        return result

    @property
    def omega(self) -> Array:
        """Ω, (R,); NaN where there is no solution."""
        return np.where(self.solved, self._triangles[:, -1, -1] ** 2, np.nan)

    @property
    def redundancy(self) -> int:
        """Conditions, prior knowledge included, less unknowns; negative at first."""
        return self._n_rows - self._x.shape[1]

    @property
    def residuals(self) -> Array:
        """Residuals v of all positions, (R, n, o); NaN where there is no solution."""
        v = self._white.solved((self._x - self._at).T)[1]
        return np.where(self.solved[:, None, None], np.moveaxis(v, 0, -1), np.nan)

    def _prior_rows(self, chosen: NDArray[np.int_]) -> Array:
        """Rows of the prior knowledge, at the point of linearisation, (R, m, u' + 1)."""
        right = (self._mean - self._at)[chosen] @ self._before.T
        left = np.broadcast_to(self._before, (len(right), *self._before.shape))
        return np.concatenate([left, right[..., None]], axis=-1)

    def _take(self, observed: Observations) -> None:
        """Take the last position of sessions."""
        problem = CalibrationProblem.of(self.model, self.approach, observed)
        new, f_a = self._newest(observed)
        # It is linearised at the estimate; the others at an earlier one.
        new = replace(new, misclosures=new.solved((self._at - self._x).T)[0])
        self._white = _joined(self._white, new)
        self._latent = np.concatenate([self._latent, f_a], axis=-1)
        self._triangles = absorb(self._triangles, _rows(new))
        self._n_rows += len(new.misclosures)
        self.n_positions += 1
        self.passes[:] = 0

        solved = np.flatnonzero(self.solved)
        self._x[solved] = self._at[solved] + solution(self._triangles[solved])
        errors = new.solved((self._x - self._at).T)[0]
        self._bent += np.sum(errors**2, axis=(0, 2))
        self._solve_first(problem)
        moved = length(self._triangles[solved], (self._x - self._at)[solved])
        self._relinearise(problem, solved, np.hypot(moved, np.sqrt(self._bent[solved])))

    def _newest(self, observed: Observations) -> tuple[Whitened, Array]:
        """Linearise the position after those taken, at the estimate and its raw observations."""
        last = observed.take(np.array([self.n_positions]))
        problem = CalibrationProblem.of(self.model, self.approach, last)
        raw = np.moveaxis(problem.observations, -1, 0)
        f_a = self._sensitive(problem, np.arange(len(self._x)))
        at = problem.conditions.linearise(self._x.T, raw, f_a)
        f_a = f_a if at.latent is None else at.latent
        return whitened(at, np.zeros_like(raw), problem.cofactors.T), f_a

    def _sensitive(self, problem: CalibrationProblem, chosen: NDArray[np.int_]) -> Array:
        """f_a of sessions at their estimates, (3, R, n)."""
        u, x = self.model.n_parameters, self._x[chosen]
        g = x[:, -1] if problem.with_gravity else problem.conditions.gravity
        hold = problem.conditions.hold
        f_a = self.model.sensitive_force(problem.observed[0][chosen], x[:, :u], g, hold)
        return np.moveaxis(f_a, -1, 0)

    def _solve_first(self, problem: CalibrationProblem) -> None:
        """Solve the sessions in which all parameters are now determined for the first time."""
        u = self._x.shape[1]
        if self._n_rows < u:
            return
        waiting = np.flatnonzero(~self.solved)
        chosen = waiting[[rank_of(self._triangles[i, :u, :u])[0] == u for i in waiting]]
        self._x[chosen] += solution(self._triangles[chosen])
        self.solved[chosen] = True
        self._rate[chosen] = 1.0
        self._relinearise(problem, chosen, np.full(len(chosen), np.inf))

    def _relinearise(
        self, problem: CalibrationProblem, chosen: NDArray[np.int_], moved: Array
    ) -> None:
        """Linearise all positions of sessions anew, if and as often as that matters.

        moved : (len(chosen),) array, how far the estimate is from where it was linearised, in
            standard deviations
        """
        if not self.n_positions:
            return
        with np.errstate(invalid="ignore"):
            due = ~(self._rate[chosen] * moved <= self.tolerance)
        active, moved = chosen[due], moved[due]
        observations, q = np.moveaxis(problem.observations, -1, 0), problem.cofactors.T
        sigma = _sigma(problem)
        largest = np.abs(observations / sigma[:, None]).max(axis=(0, 2))
        least = np.maximum(self.tolerance, ROUNDING * np.finfo(float).eps * largest)
        first = True
        for _ in range(MAX_ITERATIONS):
            if not len(active):
                return
            x, before = self._x[active], _of_sessions(self._white, active)
            v = before.solved((x - self._at[active]).T)[1]
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                at = problem.conditions.linearise(
                    x.T, observations[:, active] + v, self._latent[:, active]
                )
                white = whitened(at, v, q)
                self._at[active] = x
                _put(self._white, active, white)
                prior = absorb(no_information(*x.shape), self._prior_rows(active))
                self._triangles[active] = absorb(prior, _rows(white))
                step = solution(self._triangles[active])
                change = (white.solved(step.T)[1] - v) / sigma[:, None]
                size = np.linalg.norm(change, axis=(0, 2))
                size = np.maximum(size, length(self._triangles[active], step))
                rate = np.where(np.isfinite(moved) & (moved > 0), size / moved, 1.0)
                done = np.maximum(rate, 0.1) * size <= least[active]
            self._x[active] = x + step
            if at.latent is not None:
                self._latent[:, active] = at.latent
            if first:  # the error that a movement by a new position leaves
                self._rate[active], first = rate, False
            self._bent[active] = 0.0
            self.passes[active] += 1
            self._give_up(problem, active[~np.isfinite(size)])
            going_on = ~done & np.isfinite(size)
            active, moved = active[going_on], size[going_on]
        self._give_up(problem, active)

    def _give_up(self, problem: CalibrationProblem, failed: NDArray[np.int_]) -> None:
        """Go back to the start where no solution was found; a further position may bring one."""
        if not len(failed):
            return
        self.solved[failed] = False
        self._x[failed] = self._at[failed] = self._start[failed]
        self._latent[:, failed] = self._sensitive(problem, failed)
        raw = np.moveaxis(problem.observations[failed], -1, 0)
        at = problem.conditions.linearise(self._x[failed].T, raw, self._latent[:, failed])
        white = whitened(at, np.zeros_like(raw), problem.cofactors.T)
        _put(self._white, failed, white)
        nothing = no_information(len(failed), self._x.shape[1])
        self._triangles[failed] = absorb(absorb(nothing, self._prior_rows(failed)), _rows(white))


def _sigma(problem: CalibrationProblem) -> Array:
    """Standard deviations (o, n) of the observations; infinite where one is held fixed."""
    q = problem.cofactors.T
    return np.sqrt(np.where(q > 0, q, np.inf))


def _no_conditions(conditions: int, unknowns: int, observed: tuple[int, ...]) -> Whitened:
    """Conditions of no positions; `observed` is the shape (R, 0, o) of the observations."""
    c, u, (sessions, _, o) = conditions, unknowns, observed
    shapes = ((c, c), (c, u), (c,), (c, o))
    return Whitened(*(np.zeros((*shape, sessions, 0)) for shape in shapes))


def _joined(before: Whitened, new: Whitened) -> Whitened:
    """Join the conditions of earlier and of further positions."""
    pairs = {name: (getattr(before, name), getattr(new, name)) for name in _ARRAYS}
    return Whitened(**{name: np.concatenate(pair, axis=-1) for name, pair in pairs.items()})


def _of_sessions(whole: Whitened, chosen: NDArray[np.int_]) -> Whitened:
    """Conditions of some of the sessions."""
    return Whitened(**{n: np.take(getattr(whole, n), chosen, axis=_SESSIONS) for n in _ARRAYS})


def _put(whole: Whitened, chosen: NDArray[np.int_], part: Whitened) -> None:
    """Replace the conditions of some of the sessions, in place."""
    for name in _ARRAYS:
        getattr(whole, name)[..., chosen, :] = getattr(part, name)


def _rows(part: Whitened) -> Array:
    """Rows [Ã | −w̃] of the conditions, (R, c n, u + 1)."""
    both = np.concatenate([part.design, -part.misclosures[:, None]], axis=1)
    return both.transpose(2, 3, 0, 1).reshape(both.shape[2], -1, both.shape[1])

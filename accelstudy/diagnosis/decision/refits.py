"""Fits of the model with effects added and outlier positions left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.adjustment.quality import Solution, solve
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.evidence.candidates import Cause, Singles, reshape
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.effects import Effect
from accelstudy.sensors.models import composition_name
from accelstudy.sensors.plausibility import implausible_parameters, impossible_parameters
from accelstudy.sensors.sensor import SensorModel

Solved = tuple[Sequence[Hypothesis], Solution]

EDGE_SHARE = 0.1
"""Part of what is searched within which the least is at its end."""
RANGE_FACTOR = 1.6
"""Factor by which a setting may lie beyond the first and the last that are tried."""


def refit(base: Solution, chosen: Sequence[Hypothesis]) -> Solution | None:
    """Fit with effects added and outlier positions left out; None if it has no solution."""
    effects = [h.distinguishable for h in chosen if h.outlier is None]
    together = (*base.model.effects, *effects)
    try:
        model = SensorModel(composition_name(together), together) if effects else base.model
    except InputError:  # two effects whose parameters have the same names
        return None
    # Started from an ideal sensor, the iterations may not reach a large effect.
    start = dict(zip(base.model.parameter_names, base.parameters, strict=False))
    observed = replace(base.observed, initial=model.vector(start))
    outliers = [h.outlier for h in chosen if h.outlier is not None]
    if outliers:
        observed = observed.take(np.setdiff1d(np.arange(len(base.misclosures)), outliers))
    try:
        solution = solve(model, base.approach, observed)
    except (InputError, np.linalg.LinAlgError):
        return None
    if not base.approach.uses_angles:
        # Without a force that belongs to them, readings have no attitude.
        p = solution.parameters[: model.n_parameters]
        f_b = model.correct(observed.forces[0], p, solution.gravity, observed.hold)
        if np.isnan(f_b).any():
            return None
    return solution if solution.redundancy > 0 else None


def impossible(solution: Solution) -> list[str]:
    """Parameters that are beyond their physical bounds."""
    return impossible_parameters(*_estimates(solution))


def _estimates(solution: Solution) -> tuple[Sequence[Effect], Array, Array]:
    """Effects of a fit, their parameters and the sigmas of these."""
    sigma = np.sqrt(np.diag(solution.cofactors) * max(1.0, solution.omega / solution.redundancy))
    u = solution.model.n_parameters
    return solution.model.effects, solution.parameters[:u], sigma[:u]


class Refit(NamedTuple):
    """Causes by the names and shapes that fit best, and the fit with them."""

    causes: tuple[Cause, ...]
    solution: Solution


def best_refit(singles: Singles, chosen: Sequence[Cause]) -> Refit | None:
    """Fit with the members of classes that fit best, by their own names; None without a solution.

    To first order the members of a class are the same. Large effects are not of first order. Of
    members between which the residuals do not decide, those go first whose sizes a sensor can have.

    Parameters
    ----------
    singles : Singles, of the base fit
    chosen : causes, each with a shape
    """
    alternatives = [
        [
            one.shape if name == one.shape.name else singles.best[name]
            for name in one.members
            if name in singles.best
        ]
        for one in chosen
    ]
    frame, base = singles.frame, singles.frame.solution
    sharp = [_sharpen(frame, one) for one in product(*alternatives)]
    solved = [(one, fit) for one in sharp if (fit := refit(base, one)) is not None]
    if not solved:
        return None

    def within(pool: Sequence[Solved], difference: float) -> list[Solved]:
        least = min(fit.omega for _, fit in pool)
        return [item for item in pool if item[1].omega <= least + difference]

    undecided = within(solved, 2 * RULES.undecided)
    plausible = [x for x in undecided if not implausible_parameters(*_estimates(x[1]))]
    # Fits that differ by less count as equal: rounding errors must not choose the name.
    best, fit = within(plausible or solved, RULES.same_fit)[0]
    u = len(fit.parameters)
    named = zip(chosen, best, strict=True)
    causes = tuple(Cause(h.name, one.members, h, one.posterior) for one, h in named)
    return Refit(causes, replace(fit, cofactors=with_settings(frame, fit, best)[:u, :u]))


STEP = 1e-4
"""Change of the logarithm of a setting for a derivative by it."""


def with_settings(frame: SessionFit, fit: Solution, chosen: Sequence[Hypothesis]) -> Array:
    """Cofactors of a fit, with those of the settings that were searched for.

    The derivatives of the conditions by a setting are a further column of the design, and the
    range in which it was searched for is an observation of it.

    Parameters
    ----------
    frame : SessionFit, of the base fit
    fit : Solution, with what was chosen
    chosen : hypotheses

    Returns
    -------
    (u + s, u + s) array, of the parameters and of the logarithms of the settings; NaN of these
        where a reading has no force with a setting a little beside
    """
    model, columns, weights = fit.model, [fit.design], [np.zeros(fit.design.shape[1])]
    problem = CalibrationProblem.of(model, fit.approach, fit.observed)
    at = problem.observations[0] + fit.residuals
    for one in chosen:
        if one.smooth is None:
            continue
        shown, name, value = one.distinguishable, one.smooth, one.value
        psi = []
        for step in (-STEP, STEP):
            changed = type(shown)(**{**shown.settings, name: value * np.exp(step)})
            effects = tuple(changed if e.name == one.name else e for e in model.effects)
            trial = SensorModel(model.name, effects)
            problem = CalibrationProblem.of(trial, fit.approach, fit.observed)
            psi.append(problem.linearise(fit.parameters[None], at[None]).psi[:, 0].T)
        slope = np.linalg.solve(fit.whitening, (psi[1] - psi[0])[..., None] / (2 * STEP)).ravel()
        columns.append(np.pad(slope, (0, len(fit.design) - len(slope)))[:, None])
        tried = _values(frame, one)
        low, high = min(tried), max(tried)
        if low == high:  # the only one that shows: it was searched for on either side
            low, high = low / RANGE_FACTOR, high * RANGE_FACTOR
        weights.append(12 / np.log([high / low]) ** 2)
    design, u = np.concatenate(columns, axis=1), len(fit.parameters)
    if (every := design.shape[1]) == u:
        return fit.cofactors
    if not np.isfinite(design).all():
        cofactors = np.full((every, every), np.nan)
        cofactors[:u, :u] = fit.cofactors
        return cofactors
    # Parameters of very different units: of columns of unit length the inverse is exact enough.
    size = np.linalg.norm(design, axis=0)
    normal = (design / size).T @ (design / size) + np.diag(np.concatenate(weights) / size**2)
    return np.asarray(np.linalg.inv(normal) / np.outer(size, size))


def _values(frame: SessionFit, hypothesis: Hypothesis) -> list[float]:
    """Values of the smooth setting of an effect that are tried at first."""
    values = (h.value for h in frame.candidates[hypothesis.name].hypotheses)
    return [value for value in values if not np.isnan(value)]


def _sharpen(frame: SessionFit, chosen: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Search the settings of smooth effects by refits: a large effect is not of first order."""
    sharp, base = list(chosen), frame.solution
    for k, start in enumerate(chosen):
        if start.smooth is None:
            continue
        from scipy.optimize import minimize_scalar  # slow to import, and seldom needed

        values = _values(frame, start)
        passed = {min(values) / RANGE_FACTOR, max(values) * RANGE_FACTOR}
        ends = (*passed, *values)

        def omega(log: float, k: int = k, start: Hypothesis = start) -> float:
            trial = reshape(frame, start, float(np.exp(log)))
            if trial is None:
                return base.omega
            fit = refit(base, [*sharp[:k], trial, *sharp[k + 1 :]])
            return base.omega if fit is None else fit.omega

        at = start.value
        while True:
            low = max((v for v in ends if v < at), default=at)
            high = min((v for v in ends if v > at), default=at)
            least = minimize_scalar(
                omega, bounds=np.log([low, high]), method="bounded", options={"xatol": 1e-4}
            )
            # To first order the least may seem to be a little to one side.
            near = min((low, high), key=lambda v: abs(least.x - np.log(v)))
            inside = abs(least.x - np.log(near)) > EDGE_SHARE * np.log(high / low)
            if inside or near in passed or omega(float(np.log(near))) > least.fun:
                break
            at, passed = near, passed | {low, high}
        best = reshape(frame, start, float(np.exp(least.x)))
        if best is not None and least.fun < omega(float(np.log(start.value))):
            sharp[k] = best
    return sharp

"""Where, how warm and when to measure next, to separate two explanations best.

Two explanations of the same residuals predict different things of a position. Let one of them be
right and predict s. Then t s is seen with t = 1, and what positions tell of t, beside all
parameters of the other explanation, is the noncentrality of the test of one against the other. A
position is worth what it adds to that. Either may be the right one, so the mean of both counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.units import GON
from accelstudy.design.information import Information, position_rows
from accelstudy.diagnosis.file_format import NextPosition
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import angles_of
from accelstudy.positions.choice import CRITERION_TOLERANCE, first_best
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise

COUNT = 3
CANDIDATE_SCHEME = "fibonacci-60"
DELAYS = (0.0, 0.5, 1.0)
"""How long after the session further positions may be measured, in lengths of the session."""
LEVELS = (0.5, 0.0, 1.0)
"""Quantiles of the measured temperatures at which they may be measured."""
MIN_CHANGE = 0.5
"""Change of force, in parts of gravity, beyond which attitudes clearly differ."""

Explanation: TypeAlias = Sequence[Hypothesis]
"""Effects that may be missing: one, or several together."""
Separation: TypeAlias = tuple[tuple[str, ...], tuple[str, ...]]
"""Names that only the one, and that only the other explanation has."""


def separated(first: Explanation, second: Explanation) -> Separation:
    """Names that only the first, and that only the second of two explanations has."""
    one, other = ([h.name for h in explanation] for explanation in (first, second))
    return tuple(n for n in one if n not in other), tuple(n for n in other if n not in one)


def next_positions(
    frame: SessionFit, first: Explanation, second: Explanation
) -> list[NextPosition]:
    """Positions that separate two explanations of the same residuals best.

    Both are fitted to all positions, each together with the parameters of the model. The candidates
    are a grid of attitudes, at the lowest, middle and highest temperature so far, right after the
    session or later. Temperature and time vary only where one of the effects depends on them. One
    after the other, the candidate is chosen that adds most to the separation, in an attitude of its
    own. The wrong explanation is fitted to the new positions as well.

    Parameters
    ----------
    frame : SessionFit, of the base fit
    first, second : explanations by effects
    """
    both, chosen, last = (first, second), list[NextPosition](), frame.forces[-1]
    effects = (one.effect for one in (*first, *second))
    needed = {c for e in effects for c in compose(e.spec, (e.spec,)).hold_columns}
    only = separated(first, second)
    designs, free = [_design(frame, one) for one in both], np.array([True])
    values = [np.linalg.pinv(a, rcond=1e-10) @ frame.residuals.errors for a in designs]
    # The first column of either is what the other one predicts.
    before = [np.column_stack([designs[1 - k] @ values[1 - k], designs[k]]) for k in (0, 1)]
    while len(chosen) < COUNT and free.any():
        forces, hold = _candidates(frame, needed, last)
        rows = [candidate_rows(frame, forces, hold, one) for one in both]
        seen = [a @ x for a, x in zip(rows, values, strict=True)]
        further = [np.concatenate([seen[1 - k][..., None], rows[k]], axis=-1) for k in (0, 1)]
        gains = np.where(free, sum(map(_separations, before, further)), -np.inf)
        i = first_best(-gains, CRITERION_TOLERANCE * gains.max())
        chosen.append(_position(frame, hold, i, needed, [*only[0], *only[1]]))
        last = forces[i]
        free = free & (np.linalg.norm(forces - last, axis=1) > MIN_CHANGE * frame.solution.gravity)
        before = [np.concatenate([before[k], further[k][i]]) for k in (0, 1)]
    return chosen


def _separations(before: Array, further: Array) -> Array:
    """What each of k further positions, (k, c, p), adds to what is known of the first parameter."""
    known = Information.of(before)
    variance = known.covariance[0, 0]
    if not np.isfinite(variance):  # this explanation has all that the other one predicts
        return np.zeros(len(further))
    return 1 / (variance - known.gain(further, np.eye(1))) - 1 / variance


def _position(
    frame: SessionFit, hold: HoldConditions, i: int, needed: set[str], separates: list[str]
) -> NextPosition:
    """Position of the candidates, with what matters of its conditions."""
    at = {name: float(hold.column(name)[i]) for name in {"roll", "pitch", *needed}}
    matters = {}
    if "temperature" in at:
        matters["temperature_degC"] = at["temperature"]
    if "time" in at:
        matters["later_s"] = at["time"] - float(frame.hold.column("time")[-1])
    roll, pitch = at["roll"] / GON, at["pitch"] / GON
    return NextPosition(roll_gon=roll, pitch_gon=pitch, separates=separates, **matters)


def _candidates(frame: SessionFit, needed: set[str], before: Array) -> tuple[Array, HoldConditions]:
    """Forces (k, 3) and holds of the positions to choose from, all attitudes by all conditions.

    Steps are those from the force `before`, (3,).
    """
    measured, n = frame.hold, len(frame.forces)
    attitudes = -frame.solution.gravity * get_scheme(CANDIDATE_SCHEME).directions
    delays = np.array(DELAYS if "time" in needed else DELAYS[:1])
    levels = np.array(LEVELS if "temperature" in needed else LEVELS[:1])
    delay, level, attitude = np.meshgrid(delays, levels, range(len(attitudes)), indexing="ij")
    forces = attitudes[attitude.ravel()]
    last = measured.take(np.full(len(forces), n - 1))
    roll, pitch = angles_of(forces).T
    step_x, step_y, step_z = (forces - before).T
    time, temperature, vibration = measured.time, measured.temperature, measured.vibration
    if time is not None:
        time = time[-1] + np.ptp(time) * (delay.ravel() + 1 / max(n - 1, 1))
    if temperature is not None:
        temperature = np.quantile(temperature, level.ravel())
    if vibration is not None:
        vibration = np.full(len(forces), np.median(vibration))
    order = np.full(len(forces), n + 1.0) if time is None else time
    return forces, replace(
        last, temperature=temperature, time=time, vibration=vibration, roll=roll, pitch=pitch,
        step_x=step_x, step_y=step_y, step_z=step_z, order=order,
    )  # fmt: skip


def _design(frame: SessionFit, explanation: Explanation) -> Array:
    """Design of all positions, (m, p), by the parameters of the model and effects."""
    shown = [-frame.rows(one.effect) @ one.directions for one in explanation]
    return np.concatenate([frame.residuals.design, *shown], axis=1)


def candidate_rows(
    frame: SessionFit, forces: Array, hold: HoldConditions, explanation: Explanation = ()
) -> Array:
    """Rows of unit weight of candidates, (k, c, p), by the parameters of the model and effects.

    They are those of an ideal sensor, with the noise that the positions have on average.
    """
    solution, sigmas = frame.solution, frame.residuals.sigmas.mean(axis=0)
    observed, approach, g = solution.observed, solution.approach, solution.gravity
    sigma_angle = float(sigmas[3:].max(initial=0.0))
    noise = Noise(float(np.mean(sigmas[:3])), sigma_angle, observed.sigma_gravity)

    def rows_of(model: SensorModel) -> Array:
        return position_rows(model, approach, noise, -forces / g, g, hold, observed.angle_errors)

    columns = [rows_of(solution.model)]
    for one in explanation:
        alone = rows_of(SensorModel(one.name, (one.effect,)))
        columns.append(alone[..., : len(one.directions)] @ one.directions)
    return np.concatenate(columns, axis=-1)

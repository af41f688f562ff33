"""Where, how warm and when to measure next, to separate two explanations best.

Two explanations of the same residuals predict different things of a new position. If one of them is
right, the other one is fitted to that position as well, and then misses it by less than they differ
by, d. Its sum of squares grows by

    dᵀ (I + A Q Aᵀ)⁻¹ d,

with A its rows of unit weight for the new position and Q its cofactors so far. The noncentrality of
the test of one against the other grows by as much, so the size from which they can be told apart
(MIB) falls. Either may be the right one, so the mean of both counts.

Of a learned function, where to measure to know it better: where its mean variance falls most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from accelstudy.design.information import Information
from accelstudy.diagnosis.space.frame import SessionFit, signature
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.effects import HoldConditions
from accelstudy.effects.learned import Learned
from accelstudy.leveling.angles import angles_of
from accelstudy.positions.choice import CRITERION_TOLERANCE, first_best
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import compose

Array = NDArray[np.float64]

COUNT = 3
CANDIDATE_SCHEME = "fibonacci-60"
DELAYS = (0.0, 0.5, 1.0)
"""How long after the session further positions may be measured, in lengths of the session."""
MIN_EVEN_RATIO = 0.7
"""Ratio of the smallest to the largest gain of all attitudes from which on any of them will do."""
MIN_FORCE_CHANGE = 0.5
"""Change of force, in parts of gravity, beyond which attitudes clearly differ."""

Explanation: TypeAlias = Sequence[Hypothesis]
"""Effects that may be missing: one, or several together."""
Fit: TypeAlias = tuple[Array, Array]
"""Design (m, p) of the positions so far, in conditions of unit weight, and what they show, (m,)."""


@dataclass(frozen=True)
class NextPosition:
    """A position worth measuring.

    Attributes
    ----------
    roll, pitch : float, rad
    temperature : float or None, °C; None where it does not matter
    later : float or None, s after the last position; None where it does not matter
    anywhere : bool, whether other attitudes would do nearly as well; this one is the session's own
    separates : names that only the one, and that only the other explanation has
    gain : float, in sigmas, root of what the position by itself adds to the separation; of a
        learned function, the root of the share of its variance that the position takes away
    yaw : float or None, rad; None where it does not matter
    """

    roll: float
    pitch: float
    temperature: float | None
    later: float | None
    anywhere: bool
    separates: tuple[tuple[str, ...], tuple[str, ...]]
    gain: float
    yaw: float | None = None


def next_positions(
    frame: SessionFit, first: Explanation, second: Explanation
) -> list[NextPosition]:
    """Positions that separate two explanations of the same residuals best.

    Both are fitted to all positions, each together with the parameters of the model. The candidates
    are a grid of attitudes, at the lowest, middle and highest temperature so far, right after the
    session or later. Temperature and time vary only where one of the effects depends on them. One
    after the other, the candidate is chosen that adds most to the separation, in an attitude of its
    own. The wrong explanation is fitted to the new positions as well.

    Where the attitude hardly matters, the first attitudes of the session are repeated, so that
    readings can be compared without any model.

    Parameters
    ----------
    frame : SessionFit, of the base fit
    first, second : explanations by effects
    """
    effects = [one.effect for one in (*first, *second) if one.effect is not None]
    needed = {c for e in effects for c in compose(e.spec, (e.spec,)).hold_columns}
    g = frame.solution.gravity
    repeated = frame.forces[_distinct(frame.forces, g)]
    attitudes = np.concatenate([repeated, -g * get_scheme(CANDIDATE_SCHEME).directions])
    forces, hold = _grid(frame, attitudes, needed, frame.forces[-1])
    rivals = [_fitted(frame, one) for one in (first, second)]
    values = [np.linalg.pinv(design, rcond=1e-10) @ observed for design, observed in rivals]
    alone, chosen, anywhere, free = np.zeros(0), list[int](), False, np.ones(len(forces), bool)
    while len(chosen) < COUNT and free.any():
        # Steps are those from the position before.
        before = forces[chosen[-1]] if chosen else frame.forces[-1]
        forces, hold_then = _grid(frame, attitudes, needed, before)
        rows = [_rows(frame, forces, hold_then, one) for one in (first, second)]
        seen = [a @ x for a, x in zip(rows, values, strict=True)]
        gains = (_growth(rivals[1], rows[1], seen[0]) + _growth(rivals[0], rows[0], seen[1])) / 2
        if not chosen:
            alone = np.sqrt(gains)
            start = (
                first_best(-alone, CRITERION_TOLERANCE * alone.max())
                // len(attitudes)
                * len(attitudes)
            )
            there = alone[start : start + len(attitudes)]  # at the best temperature and time
            if anywhere := bool(there.min() >= MIN_EVEN_RATIO * there.max()):
                chosen = [start + i for i in range(len(repeated))]
                break
        gains = np.where(free, gains, -np.inf)
        i = first_best(-gains, CRITERION_TOLERANCE * gains.max())
        chosen.append(i)
        free &= np.linalg.norm(forces - forces[i], axis=1) > MIN_FORCE_CHANGE * g
        rivals = [
            (np.concatenate([design, rows[k][i]]), np.append(observed, seen[1 - k][i]))
            for k, (design, observed) in enumerate(rivals)
        ]
    names = [[one.name for one in explanation] for explanation in (first, second)]
    only = tuple(tuple(n for n in a if n not in b) for a, b in (names, names[::-1]))
    more = {"anywhere": anywhere, "separates": only}
    return [
        _position(frame, hold, i, needed - {"yaw"}, gain=float(alone[i]), **more) for i in chosen
    ]


def _position(
    frame: SessionFit, hold: HoldConditions, i: int, needed: set[str], **more: Any
) -> NextPosition:
    """Position of the candidates, with what matters of its conditions."""

    def shown(name: str) -> float | None:
        column = getattr(hold, name)
        return None if name not in needed or column is None else float(column[i])

    time, measured = shown("time"), frame.hold.time
    return NextPosition(
        roll=float(hold.column("roll")[i]),
        pitch=float(hold.column("pitch")[i]),
        temperature=shown("temperature"),
        later=None if time is None or measured is None else time - float(measured[-1]),
        yaw=shown("yaw"),
        **more,
    )


LEARNABLE = ("force", "previous", "angle", "yaw", "temperature")
"""Coordinates of which further positions can be chosen, whatever is past."""
YAWS = np.arange(-3, 5) * np.pi / 4
"""Yaws of the positions to choose from where one is a coordinate, rad."""
TEMPERATURES = 13
"""Temperatures to choose from where one is a coordinate."""
VALUES = 121
"""Values of the coordinate over which the variance of a function is taken."""


def positions_to_learn(frame: SessionFit, learned: Learned) -> list[NextPosition]:
    """Positions that show most of a learned function, one after the other.

    Parameters
    ----------
    frame : SessionFit, of the fit with the function
    learned : Learned, the function
    """
    if learned.coordinate not in LEARNABLE:
        return []
    model, solution = frame.solution.model, frame.solution
    needed = {*compose(learned.spec, (learned.spec,)).hold_columns}
    attitudes = -solution.gravity * get_scheme(CANDIDATE_SCHEME).directions
    yaws, by_heat = YAWS if "yaw" in needed else np.zeros(1), "temperature" in needed
    weights = np.zeros_like(solution.cofactors)
    own = [model.parameter_names.index(parameter.name) for parameter in learned.parameters]
    weights[np.ix_(own, own)] = _mean_squares(learned)
    known, before, chosen = Information.of_covariance(solution.cofactors), frame.forces[-1], []
    whole = float(np.sum(weights * solution.cofactors))
    for _ in range(COUNT):
        forces, hold = _grid(frame, attitudes, needed, before, yaws, TEMPERATURES * by_heat)
        rows = _rows(frame, forces, hold)
        gains = known.gain(rows, weights)
        i = first_best(-gains, CRITERION_TOLERANCE * gains.max())
        gain, of = float(np.sqrt(gains[i] / whole)), ((learned.name,), ())
        position = _position(
            frame, hold, i, needed - {"time"}, anywhere=False, separates=of, gain=gain
        )
        chosen.append(position)
        known, before = Information.of(known.rows, rows[i]), forces[i]
    return chosen


def _mean_squares(learned: Learned) -> Array:
    """Form of the parameters (k, k) that is the sum of the mean squares of all functions."""
    low, high = (
        learned.settings.get(end, turn) for end, turn in (("low", -np.pi), ("high", np.pi))
    )
    grid, k = np.linspace(low, high, VALUES), len(learned.parameters)
    shown = [learned.function(grid, unit, np.zeros((k, k)))[0].ravel() for unit in np.eye(k)]
    return np.asarray(np.array(shown) @ np.array(shown).T / VALUES)


def _distinct(forces: Array, gravity: float) -> list[int]:
    """Return the first places whose attitudes clearly differ."""
    chosen: list[int] = []
    for i in range(len(forces)):
        near = np.linalg.norm(forces[chosen] - forces[i], axis=1) <= MIN_FORCE_CHANGE * gravity
        if len(chosen) < COUNT and not near.any():
            chosen.append(i)
    return chosen


def _grid(
    frame: SessionFit,
    attitudes: Array,
    needed: set[str],
    before: Array,
    yaws: Array | None = None,
    temperatures: int = 0,
) -> tuple[Array, HoldConditions]:
    """Forces (k, 3) and holds of the positions to choose from.

    All attitudes, by all yaws, stand together for each time and temperature. Steps are those from
    the force `before`, (3,). So many temperatures lie evenly between the lowest and the highest; by
    default there are three of those that were measured.
    """
    measured, n = frame.hold, len(frame.forces)
    delays: Array = np.zeros(1)
    levels: Array = np.zeros(1)
    if measured.time is not None:
        shares = DELAYS if "time" in needed else DELAYS[:1]
        delays = np.ptp(measured.time) * (np.array(shares) + 1 / max(n - 1, 1))
    if measured.temperature is not None:
        of_all = [0.0, 0.5, 1.0] if "temperature" in needed else [0.5]
        levels = np.quantile(measured.temperature, of_all)
        if temperatures:
            levels = np.linspace(levels[0], levels[-1], temperatures)
    yaws = np.zeros(1) if yaws is None else yaws
    counts = (len(delays), len(levels), len(yaws), len(attitudes))
    of_delay, of_level, of_yaw, of_attitude = np.indices(counts).reshape(4, -1)
    forces = attitudes[of_attitude]
    last = measured.take(np.full(len(forces), n - 1))
    roll, pitch = angles_of(forces).T
    step_x, step_y, step_z = (forces - before).T
    time = None if last.time is None else last.time + delays[of_delay]
    vibration = measured.vibration
    hold = replace(
        last,
        temperature=None if last.temperature is None else levels[of_level],
        time=time,
        vibration=None if vibration is None else np.full(len(forces), np.median(vibration)),
        roll=roll,
        pitch=pitch,
        yaw=yaws[of_yaw],
        step_x=step_x,
        step_y=step_y,
        step_z=step_z,
        order=np.full(len(forces), n + 1.0) if time is None else time,
    )
    return forces, hold


def _growth(fit: Fit, rows: Array, seen: Array) -> Array:
    """How much the sum of squares of a fit grows, (k,), if candidates (k, c, p) show `seen`."""
    design, observed = fit
    inverse = np.linalg.pinv(design, rcond=1e-10)
    missed, shown = (seen - rows @ (inverse @ observed))[..., None], rows @ inverse
    noise = np.eye(rows.shape[-2]) + shown @ np.swapaxes(shown, -1, -2)
    return np.asarray(np.sum(missed * np.linalg.solve(noise, missed), axis=(1, 2)))


def _fitted(frame: SessionFit, explanation: Explanation) -> Fit:
    """Fit an explanation to all positions, together with the parameters of the model."""
    shown = [-columns for one in explanation for columns in frame.columns([one])]
    residuals = frame.residuals
    return np.concatenate([residuals.design, *shown], axis=1), residuals.errors


def _rows(
    frame: SessionFit, forces: Array, hold: HoldConditions, explanation: Explanation = ()
) -> Array:
    """Rows of unit weight of candidates, (k, c, p), by the parameters of the model and effects.

    They are those of an ideal sensor, with the noise that the positions have on average.
    """
    solution, angles = frame.solution, angles_of(forces)
    first, sigmas, common = solution.observed, frame.residuals.sigmas.mean(axis=0), None
    sigma_angle: Any = sigmas[3:5]
    if first.angle_errors is not None:
        sigma_angle, common = first.angle_errors(angles)
    observed = replace(
        first,
        forces=forces[None],
        sigma_force=float(np.mean(sigmas[:3])),
        angles=angles[None],
        sigma_angle=sigma_angle,
        common=common,
        hold=hold,
    )
    space = Residuals.at(solution.model, solution.approach, observed)
    columns, (k, c) = [space.design], space.whitening.shape[:2]
    for one in explanation:
        assert one.effect is not None
        shown = signature(one.effect, forces, angles, solution.gravity, hold)
        columns.append(-space.whiten(shown) @ one.directions)
    return np.concatenate(columns, axis=1)[: k * c].reshape(k, c, -1)

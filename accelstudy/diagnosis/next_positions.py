"""Where, how warm and when to measure next, to separate two explanations best.

Of a learned function, where to measure to know it better: a position with the whitened rows A turns
the covariance Q of the parameters into Q − Q Aᵀ (I + A Q Aᵀ)⁻¹ A Q, and so its mean variance.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.space.examined import Frame
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.diagnosis.space.signatures import Signature, signature
from accelstudy.effects import Effect, HoldConditions
from accelstudy.effects.learned import Learned
from accelstudy.leveling.angles import roll_pitch
from accelstudy.positions.choice import TIED, first_best
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import compose

Array = NDArray[np.float64]
Columns = tuple[Array, Array]
"""Derivatives of the predictions of either explanation by its p parameters, each (..., c, p)."""

COUNT = 3
GRID = "fibonacci-60"
LATER = (0.0, 0.5, 1.0)
"""How long after the session further positions may be measured, in lengths of the session."""
ANYWHERE = 0.7
"""Ratio of the smallest to the largest gain of all attitudes from which on any of them will do."""
DIFFERENT = 0.5
"""Change of force, in parts of gravity, beyond which attitudes clearly differ."""

Explanation = Sequence[Hypothesis]
"""Effects that may be missing: one, or several together."""


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


def next_positions(frame: Frame, first: Explanation, second: Explanation) -> list[NextPosition]:
    """Positions that separate two explanations of the same residuals best.

    Both are fitted to all positions, each together with the parameters of the model. The candidates
    are a grid of attitudes, at the lowest, middle and highest temperature so far, right after the
    session or later. Temperature and time vary only where one of the effects depends on them. One
    after the other, the candidate is chosen that adds most to the separation. The wrong explanation
    is fitted to the new positions as well (`accelstudy.diagnosis.next_positions`).

    Where the attitude hardly matters, the first attitudes of the session are repeated, so that
    readings can be compared without any model.

    Parameters
    ----------
    frame : Frame, of the base fit
    first, second : explanations by effects
    """
    effects = [one.effect for one in (*first, *second) if one.effect is not None]
    needed = {c for e in effects for c in compose(e.spec, (e.spec,)).hold_columns}
    g = frame.solution.gravity
    repeated = frame.forces[_apart(frame.forces, range(len(frame.forces)), g)]
    attitudes = np.concatenate([repeated, -g * get_scheme(GRID).directions])
    forces, hold, later = _grid(frame, attitudes, needed, frame.forces[-1])
    rivals = _Rivals.of(frame, first, second)
    gain = np.sqrt(rivals.separation.gains(rivals.columns(forces, hold)))

    start = first_best(-gain, TIED * gain.max()) // len(attitudes) * len(attitudes)
    there = gain[start : start + len(attitudes)]  # at the best temperature and time
    anywhere = bool(there.min() >= ANYWHERE * there.max())
    if anywhere:
        chosen = [start + i for i in range(len(repeated))]
    else:
        chosen = _one_after_the_other(rivals, attitudes, needed)
    roll, pitch = roll_pitch(tuple(forces.T))
    names = [tuple(one.name for one in explanation) for explanation in (first, second)]
    return [
        NextPosition(
            roll=float(roll[i]),
            pitch=float(pitch[i]),
            temperature=float(hold.column("temperature")[i]) if "temperature" in needed else None,
            later=None if later is None else float(later[i]),
            anywhere=anywhere,
            separates=(
                tuple(name for name in names[0] if name not in names[1]),
                tuple(name for name in names[1] if name not in names[0]),
            ),
            gain=float(gain[i]),
        )
        for i in chosen
    ]


LEARNABLE = ("force", "previous", "angle", "yaw", "temperature")
"""Coordinates of which further positions can be chosen, whatever is past."""
YAWS = np.arange(-3, 5) * np.pi / 4
"""Yaws of the positions to choose from where one is a coordinate, rad."""
TEMPERATURES = 13
"""Temperatures to choose from where one is a coordinate."""
VALUES = 121
"""Values of the coordinate over which the variance of a function is taken."""


def positions_to_learn(frame: Frame, learned: Learned) -> list[NextPosition]:
    """Positions that show most of a learned function, one after the other.

    Parameters
    ----------
    frame : Frame, of the fit with the function
    learned : Learned, the function
    """
    if learned.coordinate not in LEARNABLE:
        return []
    model, g = frame.solution.model, frame.solution.gravity
    needed = {*compose(learned.spec, (learned.spec,)).hold_columns}
    attitudes = -g * get_scheme(GRID).directions
    yaws, by_heat = YAWS if "yaw" in needed else np.zeros(1), "temperature" in needed
    u = model.n_parameters + _shared(frame)
    cofactors, weights = frame.solution.cofactors[:u, :u], np.zeros((u, u))
    own = [model.parameter_names.index(parameter.name) for parameter in learned.parameters]
    weights[np.ix_(own, own)] = _mean_squares(learned)
    whole, before, chosen = float(np.sum(weights * cofactors)), frame.forces[-1], []
    for _ in range(COUNT):
        forces, hold, _ = _grid(frame, attitudes, needed, before, yaws, TEMPERATURES * by_heat)
        columns = _whitening(frame, forces) @ _derivatives(frame, (), forces, hold)
        cross = columns @ cofactors
        noise = np.eye(columns.shape[1]) + cross @ columns.swapaxes(1, 2)
        seen = np.linalg.solve(noise, cross)
        gains = np.einsum("kcu,uv,kcv->k", seen, weights, cross)
        i = first_best(-gains, TIED * gains.max())
        roll, pitch = hold.column("roll")[i], hold.column("pitch")[i]
        chosen.append(
            NextPosition(
                roll=float(roll),
                pitch=float(pitch),
                temperature=(float(hold.column("temperature")[i]) if by_heat else None),
                later=None,
                anywhere=False,
                separates=((learned.name,), ()),
                gain=float(np.sqrt(gains[i] / whole)),
                yaw=float(hold.column("yaw")[i]) if "yaw" in needed else None,
            )
        )
        cofactors, before = cofactors - cross[i].T @ seen[i], forces[i]
    return chosen


def _mean_squares(learned: Learned) -> Array:
    """Form of the parameters (k, k) that is the sum of the mean squares of all functions."""
    low, high = (
        learned.settings.get(end, turn) for end, turn in (("low", -np.pi), ("high", np.pi))
    )
    grid, k = np.linspace(low, high, VALUES), len(learned.parameters)
    shown = [learned.function(grid, unit, np.zeros((k, k)))[0].ravel() for unit in np.eye(k)]
    return np.asarray(np.array(shown) @ np.array(shown).T / VALUES)


def _one_after_the_other(rivals: _Rivals, attitudes: Array, needed: set[str]) -> list[int]:
    """Places that add most to the separation, each after those before it, in other attitudes."""
    frame, separation = rivals.frame, rivals.separation
    chosen: list[int] = []
    taken = [frame.forces[-1]]  # steps are those from the position before
    while len(chosen) < COUNT:
        forces, hold, _ = _grid(frame, attitudes, needed, taken[-1])
        columns = rivals.columns(forces, hold)
        apart = [np.linalg.norm(forces - force, axis=1) for force in taken[1:]]
        free = np.all(np.array(apart) > DIFFERENT * frame.solution.gravity, axis=0)
        if not np.any(free):
            break
        gains = np.where(free, separation.gains(columns), -np.inf)
        chosen.append(first_best(-gains, TIED * gains.max()))
        taken.append(forces[chosen[-1]])
        separation = separation.taking((columns[0][chosen[-1]], columns[1][chosen[-1]]))
    return chosen


def _apart(forces: Array, order: Iterable[int], gravity: float) -> list[int]:
    """Return the first places, in an order, whose attitudes clearly differ."""
    chosen: list[int] = []
    for i in order:
        if all(np.linalg.norm(forces[i] - forces[j]) > DIFFERENT * gravity for j in chosen):
            chosen.append(i)
        if len(chosen) == COUNT:
            break
    return chosen


def _grid(
    frame: Frame,
    attitudes: Array,
    needed: set[str],
    before: Array,
    yaws: Array | None = None,
    temperatures: int = 0,
) -> tuple[Array, HoldConditions, Array | None]:
    """Forces (k, 3), holds and times after the session (k,) of the positions to choose from.

    All attitudes, by all yaws, stand together for each time and temperature. The times are None
    where there is nothing to choose. Steps are those from the force `before`, (3,). So many
    temperatures lie evenly between the lowest and the highest; by default there are three of those
    that were measured.
    """
    yaws = np.zeros(1) if yaws is None else yaws
    yaw, attitudes = np.repeat(yaws, len(attitudes)), np.tile(attitudes, (len(yaws), 1))
    measured, n, m = frame.hold, len(frame.forces), len(attitudes)
    delays, levels, later = np.zeros(1), np.zeros(1), None
    if measured.time is not None:
        length = float(measured.time[-1] - measured.time[0])
        chosen = LATER if "time" in needed else LATER[:1]
        delays = length * (np.array(chosen) + 1 / max(n - 1, 1))
    if measured.temperature is not None:
        shares = [0.0, 0.5, 1.0] if "temperature" in needed else [0.5]
        levels = np.quantile(measured.temperature, shares)
        if temperatures:
            levels = np.linspace(levels[0], levels[-1], temperatures)
    rounds = len(delays) * len(levels)
    grid = np.tile(attitudes, (rounds, 1))
    delay = np.repeat(delays, len(levels) * m)
    time = None if measured.time is None else measured.time[-1] + delay
    if "time" in needed and time is not None:
        later = delay
    vibration = measured.vibration
    roll, pitch = roll_pitch(tuple(grid.T))
    step = grid - before
    hold = HoldConditions(
        temperature=(
            None if measured.temperature is None else np.tile(np.repeat(levels, m), len(delays))
        ),
        time=time,
        vibration=None if vibration is None else np.full(len(grid), np.median(vibration)),
        roll=roll,
        pitch=pitch,
        yaw=np.tile(yaw, rounds),
        step_x=step[:, 0],
        step_y=step[:, 1],
        step_z=step[:, 2],
        order=np.full(len(grid), n + 1.0) if time is None else time,
        course=frame.hold.take(np.arange(n)).course,
    )
    return grid, hold, later


@dataclass(frozen=True, eq=False)
class Explained:
    """An explanation, fitted to the positions so far.

    Attributes
    ----------
    values : (p,) array, its parameters
    cofactors : (p, p) array
    """

    values: Array
    cofactors: Array

    def growth(self, columns: Array, seen: Array) -> Array:
        """How much the sum of squares grows, (k,), if candidates (k, c, p) show `seen` (k, c)."""
        missed = seen - columns @ self.values
        noise = np.eye(columns.shape[1]) + columns @ self.cofactors @ columns.swapaxes(1, 2)
        return np.asarray(
            np.einsum("kc,kc->k", missed, np.linalg.solve(noise, missed[..., None])[..., 0])
        )

    def after(self, columns: Array, seen: Array) -> Explained:
        """Fit a position (c, p) that shows `seen` (c,), too."""
        cross = columns @ self.cofactors
        weight = np.linalg.solve(np.eye(len(columns)) + cross @ columns.T, cross).T
        values = self.values + weight @ (seen - columns @ self.values)
        return Explained(values, self.cofactors - weight @ cross)


@dataclass(frozen=True, eq=False)
class Separation:
    """Two explanations, each in the role of the right one and of the wrong one.

    Their predictions for a new position differ by d. If one of them is right, the other is fitted
    to the new position as well, and then misses it by less than d. Its sum of squares grows by

        dᵀ (I + G C Gᵀ)⁻¹ d,

    with the predictions in units of their noise, their derivatives G by the parameters of the wrong
    explanation, and its cofactors C so far. The noncentrality of the test of one against the other
    grows by the same amount, so the size from which they can be told apart (MIB) falls. Either may
    be the right one, so the mean of both counts.

    Attributes
    ----------
    right : (p,) arrays, parameters by which either predicts
    wrong : Explained, either one, fitted to the positions taken so far
    """

    right: tuple[Array, Array]
    wrong: tuple[Explained, Explained]

    @classmethod
    def of(cls, first: Explained, second: Explained) -> Separation:
        """Begin with two explanations of the same positions."""
        return cls((first.values, second.values), (first, second))

    def gains(self, columns: Columns) -> Array:
        """What each of k candidates would add to the separation, (k,)."""
        seen = [c @ values for c, values in zip(columns, self.right, strict=True)]
        first, second = self.wrong
        return (second.growth(columns[1], seen[0]) + first.growth(columns[0], seen[1])) / 2

    def taking(self, columns: Columns) -> Separation:
        """Return the separation after one more position."""
        seen = [c @ values for c, values in zip(columns, self.right, strict=True)]
        first, second = self.wrong
        after = first.after(columns[0], seen[1]), second.after(columns[1], seen[0])
        return Separation(self.right, after)


@dataclass(frozen=True, eq=False)
class _Rivals:
    """Two explanations, each fitted together with the parameters of the model."""

    frame: Frame
    effects: tuple[Explanation, Explanation]
    separation: Separation

    @classmethod
    def of(cls, frame: Frame, first: Explanation, second: Explanation) -> _Rivals:
        return cls(frame, (first, second), Separation.of(_fit(frame, first), _fit(frame, second)))

    def columns(self, forces: Array, hold: HoldConditions) -> tuple[Array, Array]:
        """Derivatives of what candidates show, in units of their noise, (k, c, p) of either."""
        white = _whitening(self.frame, forces)
        one, two = (_derivatives(self.frame, e, forces, hold) for e in self.effects)
        return np.asarray(white @ one), np.asarray(white @ two)


def _fit(frame: Frame, explanation: Explanation) -> Explained:
    residuals = frame.residuals
    shown = _derivatives(frame, explanation, frame.forces, frame.hold)
    rows = residuals.rows(residuals.jac_observations[..., :3] @ shown)
    # What angles share is known to be 0 ± 1.
    u, k = frame.solution.model.n_parameters, _shared(frame)
    known = -np.eye(k, rows.shape[1], u)
    errors = np.concatenate([residuals.errors, frame.solution.parameters[u : u + k]])
    inverse = np.linalg.pinv(np.concatenate([rows, known]), rcond=1e-10)
    return Explained(inverse @ errors, inverse @ inverse.T)


def _shared(frame: Frame) -> int:
    """Number of the errors that the angles of all positions share."""
    common = frame.solution.observed.common
    return 0 if common is None or not frame.solution.approach.uses_angles else common.shape[-1]


def _derivatives(
    frame: Frame, explanation: Explanation, forces: Array, hold: HoldConditions
) -> Array:
    """Derivatives of the output by the parameters of the model and by those of the effects.

    Between them are those by the errors that the angles of all positions share.
    """
    g, turning = frame.solution.gravity, _force_by_angles(forces, frame.solution.gravity)
    angles = np.column_stack([hold.column("roll"), hold.column("pitch")])

    def shown(effect: Effect) -> Signature:
        return signature(effect, forces, angles, g, hold)

    def in_output(one: Signature) -> Array:
        return one.force + turning @ one.angles

    columns = [in_output(shown(effect)) for effect in frame.solution.model.effects]
    errors = frame.solution.observed.angle_errors
    if errors is not None and _shared(frame):
        columns.append(-turning @ errors(angles)[1])
    for one in explanation:
        assert one.effect is not None
        columns.append(in_output(shown(one.effect).reduced(one.directions)))
    return np.concatenate(columns, axis=2)


def _whitening(frame: Frame, forces: Array) -> Array:
    """Matrices (k, c, 3) that scale an output to the noise of what the approach sees of it."""
    sigmas = np.mean(frame.residuals.sigmas, axis=0)
    force = np.mean(sigmas[:3])
    if not frame.solution.approach.uses_angles:
        unit = forces / np.linalg.norm(forces, axis=1, keepdims=True)
        return np.asarray(unit[:, None] / force)
    of_angles = sigmas[3:5]
    if (errors := frame.solution.observed.angle_errors) is not None:
        angles = np.column_stack(roll_pitch(tuple(forces.T)))
        of_angles = errors(angles)[0][:, None]
    turning = _force_by_angles(forces, frame.solution.gravity) * of_angles
    noise = force**2 * np.eye(3) + turning @ turning.swapaxes(1, 2)
    return np.linalg.inv(np.linalg.cholesky(noise))


def _force_by_angles(forces: Array, g: float) -> Array:
    """Derivatives of the specific force by roll and pitch, (n, 3, 2)."""
    roll, pitch = roll_pitch(tuple(forces.T))
    sin_r, cos_r, sin_p, cos_p = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    zero = np.zeros_like(roll)
    by_roll = g * np.stack([zero, -cos_p * cos_r, cos_p * sin_r], axis=1)
    by_pitch = g * np.stack([cos_p, sin_p * sin_r, sin_p * cos_r], axis=1)
    return np.stack([by_roll, by_pitch], axis=2)

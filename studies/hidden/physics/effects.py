"""What can be wrong with a sensor and its rig, as independent forward physics.

Each effect changes one pass through the rig and the sensor, for a batch of parameters (B, k) at
once. It shares names and units with the catalogue of effects, but no code.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from studies.hidden.physics.designs import GRAVITY, Session

Array = NDArray[np.float64]
Settings = Mapping[str, float]

STILL = 0.02
"""m/s², a step between holds that is too small for any effect."""
REFERENCE = 20.0
"""°C, at which bias and scale have their stated values."""


@dataclass
class Rig:
    """How a rig differs from an ideal one; the first axis is the batch.

    Attributes
    ----------
    gravity : (B, 1, 1) array, m/s², true gravity less the stated one
    tilt : (B, 1, 3) array, rad, rotation of the base
    skew : (B, 1) array, rad, by which the roll axis is not perpendicular to the pitch axis
    deflection : (B, n, 2) array, rad, attitude of the flange less that of the joints
    mounting : (B, n, 3) array, rad, rotation of the sensor on the flange
    reading : (B, n, 2) array, rad, errors of the encoders
    """

    gravity: Array | float = 0.0
    tilt: Array = field(default_factory=lambda: np.zeros(3))
    skew: Array | float = 0.0
    deflection: Array | float = 0.0
    mounting: Array = field(default_factory=lambda: np.zeros(3))
    reading: Array | float = 0.0


RigAction = Callable[[Rig, Array, Settings, Session], None]
SensorAction = Callable[[Array, Array, Settings, Session], Array]
"""From forces along the axes (B, n, 3) and parameters (B, 1, k) to what the output gains."""
Draw = Callable[[Session, np.random.Generator], dict[str, float]]
Grid = Callable[[Session], list[dict[str, float]]]


@dataclass(frozen=True)
class Effect:
    """One effect.

    Attributes
    ----------
    name : str, canonical
    k : int, number of parameters
    typical : float, usual size of a parameter, SI
    rig : callable, changes a `Rig`; None for an effect of the sensor
    sensor : callable, what is added to the output; None for an effect of the rig
    needs : tuple of str, attributes of a session without which it cannot be seen
    in_time : bool, whether it changes within a hold
    loses : bool, whether its parameters can only be positive
    of_output : bool, whether it acts on what the sensor would read, with all other effects
    draw : callable, random settings
    grid : callable, settings that cover all there may be
    """

    name: str
    k: int
    typical: float
    rig: RigAction | None = None
    sensor: SensorAction | None = None
    needs: tuple[str, ...] = ()
    in_time: bool = False
    loses: bool = False
    of_output: bool = False
    draw: Draw = lambda session, rng: {}
    grid: Grid = lambda session: [{}]

    def shows(self, session: Session) -> bool:
        """Whether a session has what it needs."""
        return all(getattr(session, name) is not None for name in self.needs)


def steps_of(f: Array) -> Array:
    """Steps from hold to hold of forces (B, n, 3); of those that keep still, 0."""
    step = np.zeros(f.shape)
    step[:, 1:] = f[:, 1:] - f[:, :-1]
    step[abs(step) < STILL] = 0
    return step


def column(values: Array | None) -> Array:
    """A value of each hold (n,), as a column beside the axes, (n, 1)."""
    if values is None:
        raise ValueError("the session does not have what an effect needs")
    return values[:, None]


# The sensor.


def _leak_across(f: Array, p: Array, s: Settings, session: Session) -> Array:
    added = np.zeros(f.shape)
    added[..., 1] = p[..., 0] * f[..., 0]
    added[..., 2] = p[..., 1] * f[..., 0] + p[..., 2] * f[..., 1]
    return added


def _square(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * f * f / GRAVITY


def _cube(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * f * f * f / GRAVITY**2


def _asymmetry(f: Array, p: Array, s: Settings, session: Session) -> Array:
    # Another gain for positive input, of which half is a common scale factor.
    return p * (2 * np.maximum(f, 0) - f)


def _products(f: Array, p: Array, s: Settings, session: Session) -> Array:
    added = np.empty(f.shape)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        added[..., i] = f[..., i] * (p[..., 2 * i] * f[..., j] + p[..., 2 * i + 1] * f[..., k])
    return added / GRAVITY


def _clipping(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * (np.clip(f, -s["knee"], s["knee"]) - f)


def _hysteresis(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * np.sign(steps_of(f))


def _tail(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return -p * steps_of(f)


def _rectified(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * column(session.vibration) ** 2


def warmth(session: Session, tau: float = 0.0) -> Array:
    """Temperature above `REFERENCE` of a body with a lag of `tau` seconds, (n, 1), K."""
    if session.course is None or session.time is None:
        raise ValueError(f"{session.name}: has no temperature")
    return session.course.lagged(session.time, tau)[:, None] - REFERENCE


def _thermal_bias(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * warmth(session, s["tau"])


def _thermal_curve(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * warmth(session) ** 2


def _thermal_scale(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * warmth(session) * f


def _warm_up(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * np.exp(-column(session.clock) / s["tau"])


def _drift(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * column(session.clock)


def _jump(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * (column(session.clock) > s["t"])


# The rig.


def _gravity(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    rig.gravity = rig.gravity + p


def _tilt(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    # With this turn the base sees g (a, b, −1) instead of g (0, 0, −1).
    turn = np.zeros((*p.shape[:-1], 3))
    turn[..., 0], turn[..., 1] = p[..., 1], -p[..., 0]
    rig.tilt = rig.tilt + turn


def _skew(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    rig.skew = rig.skew + p[..., 0]


def _mounting(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    rig.mounting = rig.mounting + p


def _slip(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    rig.mounting = rig.mounting + p * (column(session.clock) > s["t"])


def _compliance(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    roll, pitch = session.joints.T
    shape = np.stack([np.sin(2 * roll) * np.cos(pitch), np.sin(2 * pitch) * np.cos(roll)], axis=-1)
    rig.deflection = rig.deflection + p * shape


def _encoder_offset(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    rig.reading = rig.reading + p


def _encoder_scale(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    rig.reading = rig.reading + p * session.joints


def _eccentricity(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    a, b = p[..., 0::2], p[..., 1::2]
    turn = s["order"] * session.joints
    rig.reading = rig.reading + a * np.sin(turn) + b * np.cos(turn)


# Settings.

FEWEST = 3
"""Least number of holds on either side of a sudden change."""


def _between_holds(session: Session, i: int, part: float) -> dict[str, float]:
    """Time when hold i (from 0) is over and the next has not begun."""
    low, high = session.clock[i], session.clock[i + 1]
    pause = 0.0 if session.time is None else min(session.length, 0.9 * (high - low))
    return {"t": float(low + pause / 2 + part * (high - low - pause))}


def _any_moment(session: Session, rng: np.random.Generator) -> dict[str, float]:
    i = int(rng.integers(FEWEST - 1, session.n - FEWEST))
    return _between_holds(session, i, rng.uniform(0.1, 0.9))


def _all_moments(session: Session) -> list[dict[str, float]]:
    return [_between_holds(session, i, 0.5) for i in range(1, session.n - 2)]


def _any_tau(session: Session, rng: np.random.Generator) -> dict[str, float]:
    return {"tau": session.duration * float(np.exp(rng.uniform(np.log(0.06), np.log(0.8))))}


def _all_taus(session: Session) -> list[dict[str, float]]:
    return [{"tau": session.duration * float(part)} for part in np.geomspace(0.05, 1.0, 9)]


def _any_knee(session: Session, rng: np.random.Generator) -> dict[str, float]:
    return {"knee": GRAVITY * rng.uniform(0.55, 0.93)}


def _all_knees(session: Session) -> list[dict[str, float]]:
    return [{"knee": GRAVITY * float(part)} for part in np.arange(0.525, 0.98, 0.05)]


def _any_order(session: Session, rng: np.random.Generator) -> dict[str, float]:
    return {"order": float(rng.choice([1.0, 2.0]))}


def _all_orders(session: Session) -> list[dict[str, float]]:
    return [{"order": 1.0}, {"order": 2.0}]


def _any_lag(session: Session, rng: np.random.Generator) -> dict[str, float]:
    lags = rng.random() < 0.5
    return {"tau": session.duration * rng.uniform(0.05, 0.33) if lags else 0.0}


def _all_lags(session: Session) -> list[dict[str, float]]:
    return [{"tau": session.duration * part} for part in (0.0, 0.04, 0.08, 0.14, 0.2, 0.27, 0.34)]


_TIME, _WARM = ("time",), ("time", "course")

EFFECTS: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        Effect("cross_axis_misalignment", 3, 5e-3, sensor=_leak_across),
        Effect("mounting_rotation", 3, 5e-3, rig=_mounting),
        Effect("quadratic_scale", 3, 5e-4, sensor=_square),
        Effect("cubic_scale", 3, 5e-4, sensor=_cube),
        Effect("scale_asymmetry", 3, 3e-4, sensor=_asymmetry),
        Effect("cross_coupling", 6, 3e-4, sensor=_products),
        Effect(
            "thermal_bias",
            3,
            2e-3,
            None,
            _thermal_bias,
            _WARM,
            True,
            False,
            False,
            _any_lag,
            _all_lags,
        ),
        Effect("thermal_curve", 3, 2e-4, None, _thermal_curve, _WARM, True),
        Effect("thermal_scale", 3, 1e-4, None, _thermal_scale, _WARM, True),
        Effect("warm_up", 3, 2e-2, None, _warm_up, _TIME, True, False, False, _any_tau, _all_taus),
        Effect("bias_drift", 3, 1e-6, None, _drift, _TIME, True),
        Effect(
            "bias_jump", 3, 2e-2, None, _jump, _TIME, False, False, False, _any_moment, _all_moments
        ),
        Effect("hysteresis", 3, 2e-3, sensor=_hysteresis),
        Effect("settling", 1, 3e-4, sensor=_tail),
        Effect("vibration_rectification", 3, 1e-3, None, _rectified, ("vibration",)),
        Effect(
            "saturation", 3, 5e-2, None, _clipping, (), False, True, True, _any_knee, _all_knees
        ),
        Effect("gravity_error", 1, 3e-3, rig=_gravity),
        Effect("base_tilt", 2, 5e-4, rig=_tilt),
        Effect("encoder_offset", 2, 2e-4, rig=_encoder_offset),
        Effect("encoder_scale", 2, 1e-4, rig=_encoder_scale),
        Effect("encoder_eccentricity", 4, 2e-4, _eccentricity, draw=_any_order, grid=_all_orders),
        Effect("axis_nonperpendicularity", 1, 3e-4, rig=_skew),
        Effect("joint_compliance", 2, 5e-4, rig=_compliance),
        Effect(
            "mounting_slip",
            3,
            1e-3,
            _slip,
            None,
            (),
            False,
            False,
            False,
            _any_moment,
            _all_moments,
        ),
    )
}
"""Name -> effect."""

"""Physics that is not in the catalogue, and that a diagnosis must not give a name of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from accelstudy.hidden.physics.forward.effects import (
    Effect,
    Rig,
    Settings,
    column,
    steps_of,
    warmth,
)
from accelstudy.hidden.physics.forward.session import GRAVITY, Session

Array = NDArray[np.float64]


RIPPLES = 2.5
"""Periods of a ripple in 1 g; fewer would look like two smooth effects of the catalogue."""


def _ripple(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * np.sin(2 * np.pi * RIPPLES * f / GRAVITY + s["phase"])


def _any_phase(session: Session, rng: np.random.Generator) -> dict[str, float]:
    return {"phase": rng.uniform(0, 2 * np.pi)}


def _triple_product(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * np.prod(f, axis=-1, keepdims=True) / GRAVITY**2


def _warm_square(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * warmth(session) * f * f / GRAVITY


def _scale_drift(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * column(session.clock) * f


def _swing(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * np.sin(2 * np.pi * column(session.clock) / s["period"] + s["phase"])


def _any_swing(session: Session, rng: np.random.Generator) -> dict[str, float]:
    period = session.duration * rng.uniform(0.25, 0.6)
    return {"period": period, "phase": rng.uniform(0, 2 * np.pi)}


def _sticking(f: Array, p: Array, s: Settings, session: Session) -> Array:
    # The remains of the step before the last one.
    behind = np.zeros(f.shape)
    behind[:, 1:] = np.sign(steps_of(f)[:, :-1])
    return p * behind


def _third_harmonic(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    roll = 3 * session.joints[:, 0]
    error = p[..., 0] * np.sin(roll) + p[..., 1] * np.cos(roll)
    rig.reading = rig.reading + np.stack([error, np.zeros(error.shape)], axis=-1)


def _cable(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    # The cable pulls harder the more it is wound; the encoders were zeroed at the mean pull.
    wound = column(session.yaw)
    pull = np.concatenate([wound, abs(wound)], axis=1)
    rig.deflection = rig.deflection + p * (pull - pull.mean(axis=0))


def _shaken_mounting(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    # The mounting was adjusted at the mean vibration.
    square = column(session.vibration) ** 2
    rig.mounting = rig.mounting + p * (square - square.mean())


OUTSIDE: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        Effect("ripple", 3, 3e-3, sensor=_ripple, draw=_any_phase),
        Effect("triple_product", 3, 1e-3, sensor=_triple_product),
        Effect("warm_square", 3, 3e-5, sensor=_warm_square, needs=("course",), in_time=True),
        Effect("scale_drift", 3, 1e-7, sensor=_scale_drift, needs=("time",), in_time=True),
        Effect("swing", 3, 5e-3, sensor=_swing, needs=("time",), in_time=True, draw=_any_swing),
        Effect("sticking", 3, 2e-3, sensor=_sticking),
        Effect("encoder_third_harmonic", 2, 2e-4, rig=_third_harmonic),
        Effect("cable_drag", 2, 2e-4, rig=_cable),
        Effect("shaken_mounting", 3, 1e-3, rig=_shaken_mounting, needs=("vibration",)),
    )
}
"""Name -> effect."""

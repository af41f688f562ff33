"""What the catalogue of effects knows, as independent forward physics.

It shares names and units with the catalogue, but no code.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from studies.hidden.physics.designs import GRAVITY, Array, Session
from studies.hidden.physics.kinds import Kind, Settings, steps_of, table, tilted

Drawn = Mapping[str, float]
TIMED, WARM = ("time",), ("time", "course")

# --- settings -------------------------------------------------------------------------------------

FEWEST = 3
"""Least number of holds on either side of a sudden change."""


def _between_holds(x: Session, i: int, part: float) -> dict[str, float]:
    """Time when hold i (from 0) is over and the next has not begun."""
    low, high = x.clock[i], x.clock[i + 1]
    pause = 0.0 if x.time is None else min(x.length, 0.9 * (high - low))
    return {"t": float(low + pause / 2 + part * (high - low - pause))}


def _any_moment(x: Session, rng: np.random.Generator) -> dict[str, float]:
    i = int(rng.integers(FEWEST - 1, x.n - FEWEST))
    return _between_holds(x, i, rng.uniform(0.1, 0.9))


def _any_lag(x: Session, rng: np.random.Generator) -> dict[str, float]:
    lags = rng.random() < 0.5
    return {"tau": x.duration * rng.uniform(0.05, 0.33) if lags else 0.0}


MOMENT = Settings(_any_moment, lambda x: [_between_holds(x, i, 0.5) for i in range(1, x.n - 2)])
TAU = Settings(
    lambda x, rng: {"tau": x.duration * float(np.exp(rng.uniform(np.log(0.06), np.log(0.8))))},
    lambda x: [{"tau": x.duration * float(part)} for part in np.geomspace(0.05, 1.0, 9)],
)
KNEE = Settings(
    lambda x, rng: {"knee": GRAVITY * rng.uniform(0.55, 0.93)},
    lambda x: [{"knee": GRAVITY * float(part)} for part in np.arange(0.525, 0.98, 0.05)],
)
ORDER = Settings(
    lambda x, rng: {"order": float(rng.choice([1.0, 2.0]))},
    lambda x: [{"order": 1.0}, {"order": 2.0}],
)
LAG = Settings(
    _any_lag,
    lambda x: [{"tau": x.duration * part} for part in (0.0, 0.04, 0.08, 0.14, 0.2, 0.27, 0.34)],
)

# --- kinds ----------------------------------------------------------------------------------------


def _leak_across(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    added = np.zeros(f.shape)
    added[..., 1] = p[..., 0] * f[..., 0]
    added[..., 2] = p[..., 1] * f[..., 0] + p[..., 2] * f[..., 1]
    return added


def _products(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    added = np.empty(f.shape)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        added[..., i] = f[..., i] * (p[..., 2 * i] * f[..., j] + p[..., 2 * i + 1] * f[..., k])
    return added / GRAVITY


def _eccentricity(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    turn = s["order"] * x.joints
    return p[..., 0::2] * np.sin(turn) + p[..., 1::2] * np.cos(turn)


def _compliance(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    roll, pitch = x.joints.T
    return p * np.stack(
        [np.sin(2 * roll) * np.cos(pitch), np.sin(2 * pitch) * np.cos(roll)], axis=-1
    )


EFFECTS = table(
    Kind("cross_axis_misalignment", "output", 5e-3, _leak_across),
    Kind("mounting_rotation", "mounting", 5e-3, lambda p, f, s, x: p),
    Kind("quadratic_scale", "output", 5e-4, lambda p, f, s, x: p * f * f / GRAVITY),
    Kind("cubic_scale", "output", 5e-4, lambda p, f, s, x: p * f * f * f / GRAVITY**2),
    # Another gain for positive input, of which half is a common scale factor.
    Kind("scale_asymmetry", "output", 3e-4, lambda p, f, s, x: p * (2 * np.maximum(f, 0) - f)),
    Kind("cross_coupling", "output", 3e-4, _products, count=6),
    Kind("thermal_bias", "output", 2e-3, lambda p, f, s, x: p * x.warmth(s["tau"]), WARM, LAG),
    Kind("thermal_curve", "output", 2e-4, lambda p, f, s, x: p * x.warmth() ** 2, WARM),
    Kind("thermal_scale", "output", 1e-4, lambda p, f, s, x: p * x.warmth() * f, WARM),
    Kind("warm_up", "output", 2e-2, lambda p, f, s, x: p * np.exp(-x.clock[:, None] / s["tau"]),
         TIMED, TAU),
    Kind("bias_drift", "output", 1e-6, lambda p, f, s, x: p * x.clock[:, None], TIMED),
    Kind("bias_jump", "output", 2e-2, lambda p, f, s, x: p * (x.clock[:, None] > s["t"]),
         TIMED, MOMENT),
    Kind("hysteresis", "output", 2e-3, lambda p, f, s, x: p * np.sign(steps_of(f))),
    Kind("settling", "output", 3e-4, lambda p, f, s, x: -p * steps_of(f), count=1),
    Kind("vibration_rectification", "output", 1e-3,
         lambda p, f, s, x: p * x.vibration[:, None] ** 2, ("vibration",)),
    Kind("saturation", "clipping", 5e-2,
         lambda p, f, s, x: p * (np.clip(f, -s["knee"], s["knee"]) - f), settings=KNEE),
    Kind("gravity_error", "gravity", 3e-3, lambda p, f, s, x: p),
    Kind("base_tilt", "tilt", 5e-4, lambda p, f, s, x: tilted(p)),
    Kind("encoder_offset", "reading", 2e-4, lambda p, f, s, x: p),
    Kind("encoder_scale", "reading", 1e-4, lambda p, f, s, x: p * x.joints),
    Kind("encoder_eccentricity", "reading", 2e-4, _eccentricity, settings=ORDER, count=4),
    Kind("axis_nonperpendicularity", "skew", 3e-4, lambda p, f, s, x: p[..., 0]),
    Kind("joint_compliance", "deflection", 5e-4, _compliance),
    Kind("mounting_slip", "mounting", 1e-3, lambda p, f, s, x: p * (x.clock[:, None] > s["t"]),
         settings=MOMENT),
)  # fmt: skip
"""Name -> kind."""

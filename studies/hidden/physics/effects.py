"""What the catalogue of effects knows, as independent forward physics.

It shares names and units with the catalogue, but no code.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from studies.hidden.physics.designs import GRAVITY, Array, Session
from studies.hidden.physics.kinds import (
    KNEE,
    LAG,
    MOMENT,
    ORDER,
    TAU,
    Kind,
    steps_of,
    table,
    tilted,
)

TIMED, WARM = ("time",), ("time", "course")


def _leak_across(p: Array, f: Array, s: Mapping[str, float], x: Session) -> Array:
    added = np.zeros(f.shape)
    added[..., 1] = p[..., 0] * f[..., 0]
    added[..., 2] = p[..., 1] * f[..., 0] + p[..., 2] * f[..., 1]
    return added


def _products(p: Array, f: Array, s: Mapping[str, float], x: Session) -> Array:
    added = np.empty(f.shape)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        added[..., i] = f[..., i] * (p[..., 2 * i] * f[..., j] + p[..., 2 * i + 1] * f[..., k])
    return added / GRAVITY


def _eccentricity(p: Array, f: Array, s: Mapping[str, float], x: Session) -> Array:
    turn = s["order"] * x.joints
    return p[..., 0::2] * np.sin(turn) + p[..., 1::2] * np.cos(turn)


def _compliance(p: Array, f: Array, s: Mapping[str, float], x: Session) -> Array:
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

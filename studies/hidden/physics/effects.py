"""What the catalogue of effects knows, as independent forward physics.

It shares names and units with the catalogue, but no code.
"""

from __future__ import annotations

import numpy as np

from studies.hidden.physics.designs import Session
from studies.hidden.physics.geometry import GRAVITY
from studies.hidden.physics.kinds import Kind, Setting, one_of, table

FEWEST = 3
"""Least number of holds on either side of a sudden change."""


def _between_holds(x: Session, i: int, part: float) -> float:
    """Time when hold i (from 0) is over and the next has not begun."""
    low, high = x.clock[i], x.clock[i + 1]
    pause = 0.0 if x.time is None else min(x.length, 0.9 * (high - low))
    return float(low + pause / 2 + part * (high - low - pause))


def _any_moment(x: Session, rng: np.random.Generator) -> float:
    i = int(rng.integers(FEWEST - 1, x.n - FEWEST))
    return _between_holds(x, i, rng.uniform(0.1, 0.9))


MOMENT = Setting(_any_moment, lambda x: [_between_holds(x, i, 0.5) for i in range(1, x.n - 2)])
DECAY = Setting(
    lambda x, rng: x.duration * float(np.exp(rng.uniform(np.log(0.06), np.log(0.8)))),
    lambda x: [x.duration * float(part) for part in np.geomspace(0.05, 1.0, 9)],
)
KNEE = Setting(
    lambda x, rng: GRAVITY * rng.uniform(0.55, 0.93),
    lambda x: [GRAVITY * float(part) for part in np.arange(0.525, 0.98, 0.05)],
)
LAG = Setting(
    lambda x, rng: x.duration * rng.uniform(0.05, 0.33) if rng.random() < 0.5 else 0.0,
    lambda x: [x.duration * part for part in (0.0, 0.04, 0.08, 0.14, 0.2, 0.27, 0.34)],
)

EFFECTS = table(
    Kind("cross_axis_misalignment", "output",
         "beside(0 * f[..., :1], p[..., :1] * f[..., :1],"
         " p[..., 1:2] * f[..., :1] + p[..., 2:] * f[..., 1:2])", typical=5e-3),
    Kind("mounting_rotation", "mounting", "p", typical=5e-3),
    Kind("quadratic_scale", "output", "p * f * f / g", typical=5e-4),
    Kind("cubic_scale", "output", "p * f * f * f / g**2", typical=5e-4),
    # Another gain for positive input, of which half is a common scale factor.
    Kind("scale_asymmetry", "output", "p * (2 * maximum(f, 0) - f)", typical=3e-4),
    Kind("cross_coupling", "output",
         "f * (p[..., ::2] * next_axis(f) + p[..., 1::2] * last_axis(f)) / g",
         typical=3e-4, count=6),
    Kind("thermal_bias", "output", "p * warmth(tau)", tau=LAG),
    Kind("thermal_curve", "output", "p * warmth() ** 2", typical=2e-4),
    Kind("thermal_scale", "output", "p * warmth() * f", typical=1e-4),
    Kind("thermal_nonorthogonality", "output",
         "warmth() * beside(p[..., 1:2] * f[..., 2:] - p[..., :1] * f[..., 1:2],"
         " -p[..., 2:] * f[..., 2:], 0 * f[..., :1])", typical=1e-4),
    Kind("warm_up", "output", "p * exp(-time / tau)", typical=2e-2, tau=DECAY),
    Kind("bias_drift", "output", "p * time", typical=1e-6),
    Kind("bias_jump", "output", "p * (time > t)", typical=2e-2, t=MOMENT),
    Kind("hysteresis", "output", "p * sign(steps(f))"),
    Kind("settling", "output", "-p * steps(f)", typical=3e-4, count=1),
    Kind("vibration_rectification", "output", "p * vibration**2", typical=1e-3),
    Kind("saturation", "clipping", "p * (clip(f, -knee, knee) - f)", knee=KNEE),
    Kind("gravity_error", "gravity", "p"),
    Kind("base_tilt", "tilt", "p"),
    Kind("encoder_offset", "reading", "p"),
    Kind("encoder_scale", "reading", "p * joints", typical=1e-4),
    Kind("encoder_eccentricity", "reading",
         "p[..., ::2] * sin(order * joints) + p[..., 1::2] * cos(order * joints)",
         count=4, order=one_of(1.0, 2.0)),
    Kind("axis_nonperpendicularity", "skew", "p[..., 0]"),
    Kind("joint_compliance", "deflection",
         "p * beside(sin(2 * roll) * cos(pitch), sin(2 * pitch) * cos(roll))", typical=5e-4),
    Kind("mounting_slip", "mounting", "p * (clock > t)", t=MOMENT),
)  # fmt: skip
"""Name -> kind."""

"""Further physics outside the catalogue, invented when the functions were fixed that are learned.

What the diagnosis can learn was written down first. So this is what nobody has prepared it for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from studies.hidden.physics.designs import GRAVITY, Session
from studies.hidden.physics.kinds import (
    SEED,
    Kind,
    Settings,
    before,
    between,
    factor,
    steps_of,
    table,
)
from studies.hidden.physics.outside import SHAKEN, WARM, Drawn, cycle

Array = NDArray[np.float64]
WARMING = ("warming",)
PLAY = 0.01
"""rad, a move of a joint that is too small to change the flank."""


def _weather(f: Array, s: Drawn, x: Session) -> Array:
    walk = np.cumsum(np.random.default_rng(int(s["seed"])).standard_normal(24))
    return np.interp(x.part, np.linspace(-0.1, 1.2, 24), walk - walk.mean())


def _backlash(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    move = np.diff(x.joints, axis=0, prepend=x.joints[:1])
    return p * np.where(abs(move) > PLAY, np.sign(move), 0)


def _stuck_mass(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    step = steps_of(f)
    return -p * step / GRAVITY * np.exp(-((step / (s["free"] * GRAVITY)) ** 2))


def _overload(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    peak = abs(f) / GRAVITY + 0.4 * x.shaking[:, None]
    return -p * np.sign(f) * np.maximum(peak - s["range"], 0)


def _thermal_loop(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    loop = np.tanh(x.rate) * 4 * x.part_of_range * (1 - x.part_of_range)
    return p * loop[:, None] + np.zeros(f.shape)


def _operator(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    rng = np.random.default_rng(int(s["seed"]))
    stays = np.repeat(rng.integers(-1, 2, x.n), rng.integers(2, 6, x.n))[: x.n]
    return np.pad(p * stays[:, None], ((0, 0), (0, 0), (0, 1)))


def _hanging_cable(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    roll, pitch = x.joints.T
    pull = np.stack([np.sin(x.yaw + roll), np.cos(x.yaw - 2 * pitch)], axis=-1)
    return p * (pull - pull.mean(axis=0))


def _two_back(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    away = f - before(before(f))
    away[:, :2] = 0
    return p * away * abs(f) / GRAVITY**2


COMPRESSOR = Settings(
    lambda x, rng: {"period": x.duration / x.n * rng.uniform(3.5, 9), "phase": rng.random()}
)

UNFORESEEN = table(
    # A bit of the converter is a little too heavy: above a level the output is higher.
    factor("missing_code", "force", "bias",
           lambda f, s, x: np.where(f / GRAVITY > s["level"], 1.0, 0.0),
           between(level=(-0.6, 0.6))),
    # A cooling machine in the next room runs a third of the time.
    factor("compressor", "time", "bias",
           lambda f, s, x: np.where((x.clock / s["period"] + s["phase"]) % 1 < 1 / 3, 1.0, 0.0),
           COMPRESSOR),
    # Pressure wanders, and the lid of the sensor gives way.
    factor("weather", "time", "bias", _weather, SEED),
    factor("reference_warm_up", "time", "scale",
           lambda f, s, x: np.exp(-x.part / s["part"]), between(part=(0.05, 0.4))),
    # Sun and clouds; it is level at the start.
    factor("sunlit_pier", "time", "tilt", cycle, between(cycles=(0.6, 2.5), phase=(0.0, 6.3))),
    # Beyond an angle the brake of the roll joint drags.
    factor("dragging_brake", "angle", "reading",
           lambda f, s, x: np.where(abs(x.joints[:, 0]) > s["from"], 1.0, 0.0),
           between(**{"from": (0.8, 2.4)})),
    # A dress pack that is pulled at both ends of its way, hardly in between.
    factor("dress_pack", "yaw", "scale",
           lambda f, s, x: np.cosh(2.5 * x.yaw / np.pi) / np.cosh(2.5)),
    # The gear rests on the flank that it came from.
    Kind("backlash", "reading", 2e-4, _backlash),
    # Small steps are followed late, large ones all but a little.
    Kind("stuck_mass", "output", 2e-3, _stuck_mass, settings=between(free=(0.3, 0.8))),
    # The peaks of a vibration are cut off where the force is large already.
    Kind("overload", "output", 2e-2, _overload, SHAKEN, between(range=(1.0, 1.3))),
    # A package that warms goes another way than one that cools; both meet at the ends.
    Kind("thermal_loop", "output", 5e-3, _thermal_loop, WARMING),
    # The mounting turns as its glue becomes warm.
    Kind("soft_glue", "mounting", 1e-3, lambda p, f, s, x: p * x.since_start[:, None], WARM),
    # Gas in the housing rises beside a wall that warms.
    Kind("convection", "output", 5e-3,
         lambda p, f, s, x: p * x.rate[:, None] * np.roll(f, 1, axis=-1) / GRAVITY, WARMING),
    # A beam that two axes share buckles the same way whatever their signs.
    Kind("buckling_beam", "output", 3e-3,
         lambda p, f, s, x: p * abs(f * np.roll(f, -1, axis=-1)) / GRAVITY**2),
    # Somebody stands on either side of the base, or is away.
    Kind("operator", "tilt", 3e-4, _operator, settings=SEED),
    # How it pulls depends on both angles.
    Kind("hanging_cable", "deflection", 2e-4, _hanging_cable),
    # What it remembers is the position before the last, and how far it is from now.
    Kind("two_back", "output", 2e-3, _two_back),
)  # fmt: skip
"""Name -> kind."""

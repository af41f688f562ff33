"""Further physics outside the catalogue, invented when the functions were fixed that are learned.

What the diagnosis can learn was written down first. So this is what nobody has prepared it for.
"""

from __future__ import annotations

import numpy as np

from studies.hidden.physics.designs import GRAVITY, Session
from studies.hidden.physics.effects import Rig, Settings, steps_of
from studies.hidden.physics.places import (
    Array,
    Outside,
    any_seed,
    before,
    between,
    cycle,
    of_force,
    of_hold,
    part_of_range,
    parted,
    since_start,
    vibration,
    warming,
)

# With a place.


def _missing_code(f: Array, s: Settings) -> Array:
    # A bit of the converter is a little too heavy: above a level the output is higher.
    return np.where(f / GRAVITY > s["level"], 1.0, 0.0)


def _compressor(session: Session, s: Settings) -> Array:
    # A cooling machine in the next room runs a third of the time.
    return np.where((session.clock / s["period"] + s["phase"]) % 1 < 1 / 3, 1.0, 0.0)


def _any_compressor(session: Session, rng: np.random.Generator) -> dict[str, float]:
    return {"period": session.duration / session.n * rng.uniform(3.5, 9), "phase": rng.random()}


def _brake(session: Session, s: Settings) -> Array:
    # Beyond an angle the brake of the roll joint drags.
    return np.where(abs(session.joints[:, 0]) > s["from"], 1.0, 0.0)


def _reference_warms_up(session: Session, s: Settings) -> Array:
    return np.exp(-parted(session) / s["part"])


def _weather(session: Session, s: Settings) -> Array:
    # Pressure wanders, and the lid of the sensor gives way.
    steps = np.random.default_rng(int(s["seed"])).standard_normal(24)
    walk = np.cumsum(steps)
    return np.interp(parted(session), np.linspace(-0.1, 1.2, 24), walk - walk.mean())


def _stretched(session: Session, s: Settings) -> Array:
    # A dress pack that is pulled at both ends of its way, hardly in between.
    return np.cosh(2.5 * session.yaw / np.pi) / np.cosh(2.5)


# Without one.

PLAY = 0.01
"""rad, a move of a joint that is too small to change the flank."""


def _backlash(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    # The gear rests on the flank that it came from.
    move = np.diff(session.joints, axis=0, prepend=session.joints[:1])
    came = np.where(abs(move) > PLAY, np.sign(move), 0)
    rig.reading = rig.reading + p * came


def _stuck_mass(f: Array, p: Array, s: Settings, session: Session) -> Array:
    # Small steps are followed late, large ones all but a little.
    step = steps_of(f)
    return -p * step / GRAVITY * np.exp(-((step / (s["free"] * GRAVITY)) ** 2))


def _overload(f: Array, p: Array, s: Settings, session: Session) -> Array:
    # The peaks of a vibration are cut off where the force is large already.
    peak = abs(f) / GRAVITY + 0.4 * vibration(session)[:, None]
    return -p * np.sign(f) * np.maximum(peak - s["range"], 0)


def _thermal_loop(f: Array, p: Array, s: Settings, session: Session) -> Array:
    # A package that warms goes another way than one that cools; both meet at the ends.
    part = part_of_range(session)
    loop = np.tanh(warming(session)) * 4 * part * (1 - part)
    return p * loop[:, None] + np.zeros(f.shape)


def _soft_glue(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    # The mounting turns as its glue becomes warm.
    rig.mounting = rig.mounting + p * since_start(session)[:, None]


def _convection(f: Array, p: Array, s: Settings, session: Session) -> Array:
    # Gas in the housing rises beside a wall that warms.
    return p * warming(session)[:, None] * np.roll(f, 1, axis=-1) / GRAVITY


def _buckling_beam(f: Array, p: Array, s: Settings, session: Session) -> Array:
    # A beam that two axes share buckles the same way whatever their signs.
    return p * abs(f * np.roll(f, -1, axis=-1)) / GRAVITY**2


def _operator(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    # Somebody stands on either side of the base, or is away.
    rng = np.random.default_rng(int(s["seed"]))
    stays = np.repeat(rng.integers(-1, 2, session.n), rng.integers(2, 6, session.n))[: session.n]
    turn = np.zeros((len(p), session.n, 3))
    turn[..., :2] = p * stays[:, None]
    rig.tilt = rig.tilt + turn


def _hanging_cable(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    # How it pulls depends on both angles.
    roll, pitch = session.joints.T
    pull = np.stack([np.sin(session.yaw + roll), np.cos(session.yaw - 2 * pitch)], axis=-1)
    rig.deflection = rig.deflection + p * (pull - pull.mean(axis=0))


def _two_back(f: Array, p: Array, s: Settings, session: Session) -> Array:
    # What it remembers is the position before the last, and how far it is from now.
    away = f - before(before(f))
    away[:, :2] = 0
    return p * away * abs(f) / GRAVITY**2


UNFORESEEN: dict[str, Outside] = {
    kind.name: kind
    for kind in (
        of_force("missing_code", ("force", "bias"), _missing_code, between(level=(-0.6, 0.6))),
        of_hold("compressor", ("time", "bias"), _compressor, _any_compressor),
        of_hold("weather", ("time", "bias"), _weather, any_seed),
        of_hold(
            "reference_warm_up", ("time", "scale"), _reference_warms_up, between(part=(0.05, 0.4))
        ),
        # Sun and clouds; it is level at the start.
        of_hold(
            "sunlit_pier",
            ("time", "tilt"),
            cycle,
            between(cycles=(0.6, 2.5), phase=(0.0, 6.3)),
        ),
        of_hold("dragging_brake", ("angle", "reading"), _brake, between(**{"from": (0.8, 2.4)})),
        of_hold("dress_pack", ("yaw", "scale"), _stretched),
        Outside("backlash", 2, 2e-4, rig=_backlash),
        Outside("stuck_mass", 3, 2e-3, sensor=_stuck_mass, draw=between(free=(0.3, 0.8))),
        Outside(
            "overload",
            3,
            2e-2,
            sensor=_overload,
            needs=("vibration",),
            draw=between(range=(1.0, 1.3)),
        ),
        Outside("thermal_loop", 3, 5e-3, sensor=_thermal_loop, needs=("warming",), in_time=True),
        Outside("soft_glue", 3, 1e-3, rig=_soft_glue, needs=("course",), in_time=True),
        Outside("convection", 3, 5e-3, sensor=_convection, needs=("warming",), in_time=True),
        Outside("buckling_beam", 3, 3e-3, sensor=_buckling_beam),
        Outside("operator", 2, 3e-4, rig=_operator, draw=any_seed),
        Outside("hanging_cable", 2, 2e-4, rig=_hanging_cable),
        Outside("two_back", 3, 2e-3, sensor=_two_back),
    )
}
"""Name -> effect."""

"""Physics that was never in the catalogue of effects, as independent forward physics.

Most kinds are a function of one *coordinate* of the holds, such as the yaw, that changes one
*target*, such as the bias. That is their true place. The others are a function of no coordinate, of
two at once, or change something else: they have no place.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from studies.hidden.physics.designs import GRAVITY, Session
from studies.hidden.physics.kinds import (
    PHASE,
    SEED,
    TURN,
    Kind,
    Settings,
    before,
    between,
    cycles,
    factor,
    steps_of,
    table,
)
from studies.hidden.physics.measuring import flange_force

Array = NDArray[np.float64]
Drawn = Mapping[str, float]
TIMED, SHAKEN, WARM = ("time",), ("vibration",), ("course",)

RIPPLES = 2.5
"""Periods of a ripple in 1 g; fewer would look like two smooth effects of the catalogue."""


def _early_departure(f: Array, s: Drawn, x: Session) -> Array:
    ahead = np.zeros(f.shape)
    ahead[:, :-1] = f[:, 1:] - f[:, :-1]
    return ahead / GRAVITY


def _third_harmonic(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    roll = 3 * x.joints[:, 0]
    error = p[..., 0] * np.sin(roll) + p[..., 1] * np.cos(roll)
    return np.stack([error, np.zeros(error.shape)], axis=-1)


def _cable(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    pull = np.stack([x.yaw, abs(x.yaw)], axis=1)
    return p * (pull - pull.mean(axis=0))


def cycle(f: Array, s: Drawn, x: Session) -> Array:
    """Return some cycles over the session, zero at its start, (n,)."""
    return np.sin(TURN * x.part * s["cycles"] + s["phase"]) - np.sin(s["phase"])


def _creep(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    memory = np.zeros(f.shape)
    for i in range(1, x.n):
        memory[:, i] = s["kept"] * memory[:, i - 1] + (1 - s["kept"]) * f[:, i - 1]
    return p * memory / GRAVITY


def _telegraph(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    changes = np.random.default_rng(int(s["seed"])).random(x.n) < 0.25
    return p * (np.cumsum(changes) % 2)[:, None] + np.zeros(f.shape)


def _chirp(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    turns = s["first"] * x.part + s["more"] * x.part**2
    return p * np.sin(TURN * turns + s["phase"])[:, None] + np.zeros(f.shape)


def _room_magnet(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    north = np.array([np.cos(s["dip"]), 0.0, np.sin(s["dip"])])
    return p * flange_force(x.joints, x.yaw, north) + np.zeros(f.shape)


def _roll_cycle(f: Array, s: Drawn, x: Session) -> Array:
    return np.sin(s["order"] * x.joints[:, 0] + s["phase"])


def _yaw_cycle(f: Array, s: Drawn, x: Session) -> Array:
    return np.sin(s["order"] * x.yaw + s["phase"])


def _long_way(f: Array, s: Drawn, x: Session) -> Array:
    return (x.way / np.pi) ** s["power"]


def _shaking(f: Array, s: Drawn, x: Session) -> Array:
    return x.shaking - 1


SWING = Settings(
    lambda x, rng: {"period": x.duration * rng.uniform(0.25, 0.6), "phase": rng.uniform(0, TURN)}
)
CHIRP = Settings(
    lambda x, rng: {
        "first": rng.uniform(0.02, 0.08) * x.n,
        "more": rng.uniform(0.1, 0.2) * x.n,
        "phase": rng.uniform(0, TURN),
    }
)

OUTSIDE = table(
    # The force of the same axis, of the next axis, of the hold before and of the next hold.
    factor("ripple", "force", "bias",
           lambda f, s, x: np.sin(TURN * RIPPLES * f / GRAVITY + s["phase"]), PHASE),
    # The spring of the next axis touches its stop, whatever the sign.
    factor("rectified_leak", "force", "bias",
           lambda f, s, x: np.maximum(abs(np.roll(f, -1, axis=-1)) / GRAVITY - s["free"], 0),
           between(free=(0.3, 0.7))),
    # The next axis, pulled far, stiffens this one.
    factor("transverse_gain", "force", "scale",
           lambda f, s, x: (np.roll(f, -1, axis=-1) / GRAVITY) ** 4),
    # Charge that the last position has left in the dielectric, whatever its sign.
    factor("dielectric_charging", "previous", "bias",
           lambda f, s, x: (before(f) / GRAVITY) ** 2),
    factor("tired_spring", "previous", "scale", lambda f, s, x: abs(before(f)) / GRAVITY),
    # The robot leaves before the mean of the hold is over.
    factor("early_departure", "next", "bias", _early_departure),
    # The attitude of the robot and its way.
    factor("ring_magnet", "angle", "bias", _roll_cycle, cycles(2.0, 3.0)),
    factor("joint_current", "angle", "scale", _roll_cycle, cycles(2.0, 3.0)),
    # The head is heavier on one side of the roll axis.
    factor("heavy_head", "angle", "tilt",
           lambda f, s, x: np.sin(x.joints[:, 0] + s["phase"]), PHASE),
    Kind("encoder_third_harmonic", "reading", 2e-4, _third_harmonic, place=("angle", "reading")),
    factor("slip_ring", "yaw", "bias", _yaw_cycle, cycles(1.0, 2.0)),
    # A cable that is wound up either way has more resistance.
    factor("wound_supply", "yaw", "scale", lambda f, s, x: (x.yaw / np.pi) ** 2),
    factor("bearing_wobble", "yaw", "tilt", _yaw_cycle, cycles(2.0, 3.0)),
    # The cable pulls harder the more it is wound; the encoders were zeroed at the mean pull.
    Kind("cable_drag", "deflection", 2e-4, _cable, place=("yaw", "reading")),
    factor("motor_heat", "move", "bias", _long_way, between(power=(1.0, 2.0))),
    factor("sagging_base", "move", "tilt", _long_way, between(power=(0.7, 1.5))),
    # A belt gives way until it is taut.
    factor("slack_belt", "move", "reading",
           lambda f, s, x: -np.expm1(-x.way / s["taut"]) - 0.5, between(taut=(1.0, 3.0))),
    # What the holds are exposed to.
    factor("rattle", "vibration", "bias",
           lambda f, s, x: np.exp(-(((x.shaking - s["at"]) / s["width"]) ** 2) / 2),
           between(at=(0.6, 1.4), width=(0.15, 0.35))),
    factor("shaken_gain", "vibration", "scale", _shaking),
    factor("soft_feet", "vibration", "tilt", _shaking),
    # Nothing moves up to a vibration, which shakes a coupling loose.
    factor("loose_coupling", "vibration", "reading",
           lambda f, s, x: np.maximum(x.shaking - s["holds"], 0), between(holds=(0.3, 1.0))),
    # A quartz resonator loses activity at one temperature, where another mode crosses.
    factor("activity_dip", "temperature", "bias",
           lambda f, s, x: 1 / (1 + ((x.part_of_range - s["at"]) / s["width"]) ** 2),
           between(at=(0.2, 0.8), width=(0.06, 0.15))),
    factor("gain_curve", "temperature", "scale",
           lambda f, s, x: (2 * (x.part_of_range - s["turn"])) ** 2, between(turn=(0.3, 0.7))),
    factor("warm_pillar", "temperature", "tilt", lambda f, s, x: x.since_start),
    factor("warm_encoder", "temperature", "reading",
           lambda f, s, x: x.since_start * abs(x.since_start)),
    factor("thermal_shock", "dT/dt", "bias", lambda f, s, x: abs(x.rate)),
    factor("gradient_gain", "dT/dt", "scale", lambda f, s, x: x.rate),
    # One side of the pillar warms first.
    factor("uneven_pillar", "dT/dt", "tilt",
           lambda f, s, x: np.tanh(x.rate / s["most"]), between(most=(0.5, 3.0))),
    factor("swing", "time", "bias",
           lambda f, s, x: np.sin(TURN * x.clock / s["period"] + s["phase"]), SWING),
    factor("scale_drift", "time", "scale", lambda f, s, x: x.part),
    factor("sinking_tripod", "time", "tilt",
           lambda f, s, x: np.log1p(x.part / s["knee"]), between(knee=(0.02, 0.3))),
    # The cabinet of the electronics is cooled and warms up in turn; zeroed at the start.
    factor("cabinet_cycle", "time", "reading", cycle,
           between(cycles=(1.2, 3.0), phase=(0.0, 6.3))),
    # No place: several coordinates at once, a memory, chance, or another target.
    Kind("triple_product", "output", 1e-3,
         lambda p, f, s, x: p * np.prod(f, axis=-1, keepdims=True) / GRAVITY**2),
    Kind("warm_square", "output", 3e-5, lambda p, f, s, x: p * x.warmth() * f * f / GRAVITY, WARM),
    # Each hour the cable gets tighter, and pulls at the housing as it is wound.
    Kind("tightening_cable", "output", 5e-3,
         lambda p, f, s, x: p * (x.part * x.yaw / np.pi)[:, None] + np.zeros(f.shape), TIMED),
    # The remains of the step before the last one.
    Kind("sticking", "output", 2e-3, lambda p, f, s, x: p * before(np.sign(steps_of(f)))),
    # A glue that yields: each hold before has a part in what it remembers.
    Kind("creep", "output", 5e-3, _creep, settings=between(kept=(0.5, 0.85))),
    # The mounting was adjusted at the mean vibration.
    Kind("shaken_mounting", "mounting", 1e-3,
         lambda p, f, s, x: p * (x.vibration**2 - np.mean(x.vibration**2))[:, None], SHAKEN),
    # A trap in the oxide is full or empty; it changes between two holds in one of four cases.
    Kind("telegraph_noise", "output", 5e-3, _telegraph, settings=SEED),
    # Two clocks of which one warms up beat faster and faster.
    Kind("chirp", "output", 5e-3, _chirp, TIMED, CHIRP),
    # A magnetic field that dips into the ground.
    Kind("room_magnet", "output", 5e-3, _room_magnet, settings=between(dip=(0.8, 1.3))),
)  # fmt: skip
"""Name -> kind."""

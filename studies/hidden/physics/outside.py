"""Physics that was never in the catalogue of effects, as independent forward physics."""

from __future__ import annotations

import numpy as np

from studies.hidden.physics.designs import GRAVITY, Session
from studies.hidden.physics.effects import Rig, Settings, column, steps_of, warmth
from studies.hidden.physics.measuring import flange_force
from studies.hidden.physics.places import (
    TARGETS,
    Array,
    Outside,
    any_cycle,
    any_phase,
    any_seed,
    before,
    between,
    cycle,
    of_bias,
    of_force,
    of_hold,
    part_of_range,
    parted,
    since_start,
    vibration,
    warming,
)

# The force of the same axis, of the other axes, of the hold before and of the next.

RIPPLES = 2.5
"""Periods of a ripple in 1 g; fewer would look like two smooth effects of the catalogue."""


def _ripple(f: Array, s: Settings) -> Array:
    return np.sin(2 * np.pi * RIPPLES * f / GRAVITY + s["phase"])


def _rectified_leak(f: Array, s: Settings) -> Array:
    # The spring of the next axis touches its stop, whatever the sign.
    return np.maximum(abs(np.roll(f, -1, axis=-1)) / GRAVITY - s["free"], 0)


def _transverse_gain(f: Array, s: Settings) -> Array:
    # The next axis, pulled far, stiffens this one.
    return (np.roll(f, -1, axis=-1) / GRAVITY) ** 4


def _charging(f: Array, s: Settings) -> Array:
    # Charge that the last position has left in the dielectric, whatever its sign.
    return (before(f) / GRAVITY) ** 2


def _tired_spring(f: Array, s: Settings) -> Array:
    return abs(before(f)) / GRAVITY


def _early_departure(f: Array, s: Settings) -> Array:
    # The robot leaves before the mean of the hold is over.
    ahead = np.zeros(f.shape)
    ahead[:, :-1] = f[:, 1:] - f[:, :-1]
    return ahead / GRAVITY


# The attitude of the robot and its way.


def _roll_cycle(session: Session, s: Settings) -> Array:
    return np.sin(s["order"] * session.joints[:, 0] + s["phase"])


def _head_load(session: Session, s: Settings) -> Array:
    # The head is heavier on one side of the roll axis.
    return np.sin(session.joints[:, 0] + s["phase"])


def _yaw_cycle(session: Session, s: Settings) -> Array:
    return np.sin(s["order"] * session.yaw + s["phase"])


def _wound(session: Session, s: Settings) -> Array:
    # A cable that is wound up either way has more resistance.
    return (session.yaw / np.pi) ** 2


def _long_way(session: Session, s: Settings) -> Array:
    return (session.way / np.pi) ** s["power"]


def _slack(session: Session, s: Settings) -> Array:
    # A belt gives way until it is taut.
    return -np.expm1(-session.way / s["taut"]) - 0.5


def _third_harmonic(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    roll = 3 * session.joints[:, 0]
    error = p[..., 0] * np.sin(roll) + p[..., 1] * np.cos(roll)
    rig.reading = rig.reading + np.stack([error, np.zeros(error.shape)], axis=-1)


def _cable(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    # The cable pulls harder the more it is wound; the encoders were zeroed at the mean pull.
    wound = column(session.yaw)
    pull = np.concatenate([wound, abs(wound)], axis=1)
    rig.deflection = rig.deflection + p * (pull - pull.mean(axis=0))


# What the holds are exposed to.


def _rattle(session: Session, s: Settings) -> Array:
    return np.exp(-(((vibration(session) - s["at"]) / s["width"]) ** 2) / 2)


def _shaking(session: Session, s: Settings) -> Array:
    return vibration(session) - 1


def _loose(session: Session, s: Settings) -> Array:
    # Nothing moves up to a vibration, which shakes a coupling loose.
    return np.maximum(vibration(session) - s["holds"], 0)


def _activity_dip(session: Session, s: Settings) -> Array:
    # A quartz resonator loses activity at one temperature, where another mode crosses.
    return 1 / (1 + ((part_of_range(session) - s["at"]) / s["width"]) ** 2)


def _gain_curve(session: Session, s: Settings) -> Array:
    return (2 * (part_of_range(session) - s["turn"])) ** 2


def _warmer(session: Session, s: Settings) -> Array:
    return since_start(session)


def _warmer_square(session: Session, s: Settings) -> Array:
    return since_start(session) * abs(since_start(session))


def _shock(session: Session, s: Settings) -> Array:
    return abs(warming(session))


def _rate(session: Session, s: Settings) -> Array:
    return warming(session)


def _uneven(session: Session, s: Settings) -> Array:
    # One side of the pillar warms first.
    return np.tanh(warming(session) / s["most"])


# Time.


def _swing(session: Session, s: Settings) -> Array:
    return np.sin(2 * np.pi * session.clock / s["period"] + s["phase"])


def _any_swing(session: Session, rng: np.random.Generator) -> dict[str, float]:
    period = session.duration * rng.uniform(0.25, 0.6)
    return {"period": period, "phase": rng.uniform(0, 2 * np.pi)}


def _scale_drift(session: Session, s: Settings) -> Array:
    return parted(session)


def _sinking(session: Session, s: Settings) -> Array:
    return np.log1p(parted(session) / s["knee"])


# No place: several coordinates at once, none, or another target.


def _triple_product(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * np.prod(f, axis=-1, keepdims=True) / GRAVITY**2


def _warm_square(f: Array, p: Array, s: Settings, session: Session) -> Array:
    return p * warmth(session) * f * f / GRAVITY


def _tightening_cable(f: Array, p: Array, s: Settings, session: Session) -> Array:
    # Each hour the cable gets tighter, and pulls at the housing as it is wound.
    return p * (parted(session) * session.yaw / np.pi)[:, None] + np.zeros(f.shape)


def _sticking(f: Array, p: Array, s: Settings, session: Session) -> Array:
    # The remains of the step before the last one.
    return p * before(np.sign(steps_of(f)))


def _creep(f: Array, p: Array, s: Settings, session: Session) -> Array:
    # A glue that yields: each hold before has a part in what it remembers.
    memory = np.zeros(f.shape)
    for i in range(1, session.n):
        memory[:, i] = s["kept"] * memory[:, i - 1] + (1 - s["kept"]) * f[:, i - 1]
    return p * memory / GRAVITY


def _shaken_mounting(rig: Rig, p: Array, s: Settings, session: Session) -> None:
    # The mounting was adjusted at the mean vibration.
    square = column(session.vibration) ** 2
    rig.mounting = rig.mounting + p * (square - square.mean())


def _telegraph(f: Array, p: Array, s: Settings, session: Session) -> Array:
    # A trap in the oxide is full or empty; it changes between two holds in one of four cases.
    rng = np.random.default_rng(int(s["seed"]))
    changes = rng.random(session.n) < 0.25
    return p * (np.cumsum(changes) % 2)[:, None] + np.zeros(f.shape)


def _chirp(session: Session, s: Settings) -> Array:
    # Two clocks of which one warms up beat faster and faster.
    part = parted(session)
    return np.sin(2 * np.pi * (s["first"] * part + s["more"] * part**2) + s["phase"])


def _any_chirp(session: Session, rng: np.random.Generator) -> dict[str, float]:
    holds = session.n
    return {
        "first": rng.uniform(0.02, 0.08) * holds,
        "more": rng.uniform(0.1, 0.2) * holds,
        "phase": rng.uniform(0, 2 * np.pi),
    }


def _room_magnet(f: Array, p: Array, s: Settings, session: Session) -> Array:
    # A magnetic field that dips into the ground.
    north = np.array([np.cos(s["dip"]), 0.0, np.sin(s["dip"])])
    return p * flange_force(session.joints, session.yaw, north) + np.zeros(f.shape)


_BIAS, _SCALE, _TILT, _READING = TARGETS

OUTSIDE: dict[str, Outside] = {
    kind.name: kind
    for kind in (
        of_force("ripple", ("force", _BIAS), _ripple, any_phase),
        of_force("rectified_leak", ("force", _BIAS), _rectified_leak, between(free=(0.3, 0.7))),
        of_force("transverse_gain", ("force", _SCALE), _transverse_gain),
        of_force("dielectric_charging", ("previous", _BIAS), _charging),
        of_force("tired_spring", ("previous", _SCALE), _tired_spring),
        of_force("early_departure", ("next", _BIAS), _early_departure),
        of_hold("ring_magnet", ("angle", _BIAS), _roll_cycle, any_cycle(2.0, 3.0)),
        of_hold("joint_current", ("angle", _SCALE), _roll_cycle, any_cycle(2.0, 3.0)),
        of_hold("heavy_head", ("angle", _TILT), _head_load, any_phase),
        Outside("encoder_third_harmonic", 2, 2e-4, rig=_third_harmonic, place=("angle", _READING)),
        of_hold("slip_ring", ("yaw", _BIAS), _yaw_cycle, any_cycle(1.0, 2.0)),
        of_hold("wound_supply", ("yaw", _SCALE), _wound),
        of_hold("bearing_wobble", ("yaw", _TILT), _yaw_cycle, any_cycle(2.0, 3.0)),
        Outside("cable_drag", 2, 2e-4, rig=_cable, place=("yaw", _READING)),
        of_hold("motor_heat", ("move", _BIAS), _long_way, between(power=(1.0, 2.0))),
        of_hold("sagging_base", ("move", _TILT), _long_way, between(power=(0.7, 1.5))),
        of_hold("slack_belt", ("move", _READING), _slack, between(taut=(1.0, 3.0))),
        of_hold(
            "rattle", ("vibration", _BIAS), _rattle, between(at=(0.6, 1.4), width=(0.15, 0.35))
        ),
        of_hold("shaken_gain", ("vibration", _SCALE), _shaking),
        of_hold("soft_feet", ("vibration", _TILT), _shaking),
        of_hold("loose_coupling", ("vibration", _READING), _loose, between(holds=(0.3, 1.0))),
        of_hold(
            "activity_dip",
            ("temperature", _BIAS),
            _activity_dip,
            between(at=(0.2, 0.8), width=(0.06, 0.15)),
        ),
        of_hold("gain_curve", ("temperature", _SCALE), _gain_curve, between(turn=(0.3, 0.7))),
        of_hold("warm_pillar", ("temperature", _TILT), _warmer),
        of_hold("warm_encoder", ("temperature", _READING), _warmer_square),
        of_hold("thermal_shock", ("dT/dt", _BIAS), _shock),
        of_hold("gradient_gain", ("dT/dt", _SCALE), _rate),
        of_hold("uneven_pillar", ("dT/dt", _TILT), _uneven, between(most=(0.5, 3.0))),
        of_hold("swing", ("time", _BIAS), _swing, _any_swing),
        of_hold("scale_drift", ("time", _SCALE), _scale_drift),
        of_hold("sinking_tripod", ("time", _TILT), _sinking, between(knee=(0.02, 0.3))),
        # The cabinet of the electronics is cooled and warms up in turn; zeroed at the start.
        of_hold(
            "cabinet_cycle",
            ("time", _READING),
            cycle,
            between(cycles=(1.2, 3.0), phase=(0.0, 6.3)),
        ),
        Outside("triple_product", 3, 1e-3, sensor=_triple_product),
        Outside("warm_square", 3, 3e-5, sensor=_warm_square, needs=("course",), in_time=True),
        Outside(
            "tightening_cable", 3, 5e-3, sensor=_tightening_cable, needs=("time",), in_time=True
        ),
        Outside("sticking", 3, 2e-3, sensor=_sticking),
        Outside("creep", 3, 5e-3, sensor=_creep, draw=between(kept=(0.5, 0.85))),
        Outside("shaken_mounting", 3, 1e-3, rig=_shaken_mounting, needs=("vibration",)),
        Outside("telegraph_noise", 3, 5e-3, sensor=_telegraph, draw=any_seed),
        Outside(
            "chirp",
            3,
            5e-3,
            sensor=of_bias(_chirp),
            needs=("time",),
            in_time=True,
            draw=_any_chirp,
        ),
        Outside("room_magnet", 3, 5e-3, sensor=_room_magnet, draw=between(dip=(0.8, 1.3))),
    )
}
"""Name -> effect."""

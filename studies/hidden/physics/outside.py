"""Physics that was never in the catalogue of effects, as independent forward physics.

Most kinds are a function of one *coordinate* of the holds, such as the yaw, that changes one
*target*, such as the bias. That is their true place. The others are a function of no coordinate, of
two at once, or change something else: they have no place.

What nobody has foreseen was invented when the functions were fixed that a diagnosis learns, which
had been written down first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from studies.hidden.physics.designs import GRAVITY, Array, Session
from studies.hidden.physics.kinds import Kind, Place, Settings, steps_of, table, tilted
from studies.hidden.physics.measuring import flange_force

Drawn = Mapping[str, float]
TIMED, SHAKEN, WARM, WARMING = ("time",), ("vibration",), ("course",), ("warming",)
NEEDS: Mapping[str, tuple[str, ...]] = {
    "vibration": SHAKEN, "temperature": WARM, "time": TIMED, "dT/dt": WARMING,
}  # fmt: skip
"""Coordinate -> attributes of a session without which it does not exist; others always do."""
FACTORS: Mapping[str, tuple[str, float, Callable[[Array, Array, Array], Array]]] = {
    "bias": ("output", 5e-3, lambda p, f, h: p * h + np.zeros(f.shape)),
    "scale": ("output", 5e-4, lambda p, f, h: p * h * f),
    "tilt": ("tilt", 5e-4, lambda p, f, h: tilted(p * h)),
    "reading": ("reading", 2e-4, lambda p, f, h: p * h),
}
"""Target of a function h of about 1 -> what it is in the rig, usual size, and the change."""


def factor(
    name: str,
    coordinate: str,
    target: str,
    h: Callable[..., Array],
    settings: Settings | None = None,
    needs: tuple[str, ...] = (),
) -> Kind:
    """Kind by a function h of forces f, settings s and session x, a factor of its parameters.

    It has a place if it is a function of one coordinate.
    """
    of_rig, typical, change = FACTORS[target]

    def function(p: Array, f: Array, s: Mapping[str, float], x: Session) -> Array:
        values = h(f, s, x)
        return change(p, f, values[:, None] if values.ndim == 1 else values)

    place = (coordinate, target) if coordinate else None
    needs = needs or NEEDS.get(coordinate, ())
    return Kind(name, of_rig, typical, function, needs, settings or Settings(), place)


def before(values: Array) -> Array:
    """Values (B, n, 3) of the hold before each; of the first one, 0."""
    moved = np.zeros(values.shape)
    moved[:, 1:] = values[:, :-1]
    return moved


# --- settings -------------------------------------------------------------------------------------

TURN = 2 * np.pi
PHASE = Settings(lambda x, rng: {"phase": rng.uniform(0, TURN)})
SEED = Settings(lambda x, rng: {"seed": float(rng.integers(1 << 31))})
"""Of what is random in itself."""


def cycles(*orders: float) -> Settings:
    """A number of cycles per turn among some, with a phase."""
    return Settings(
        lambda x, rng: {"order": float(rng.choice(orders)), "phase": rng.uniform(0, TURN)}
    )


def between(**ranges: tuple[float, float]) -> Settings:
    """Settings, each evenly between two bounds."""
    return Settings(lambda x, rng: {name: rng.uniform(*ends) for name, ends in ranges.items()})


# --- kinds ----------------------------------------------------------------------------------------

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


def _cycle(f: Array, s: Drawn, x: Session) -> Array:
    """Return some cycles over the session, zero at its start, (n,)."""
    return np.sin(TURN * x.part * s["cycles"] + s["phase"]) - np.sin(s["phase"])


def _creep(p: Array, f: Array, s: Drawn, x: Session) -> Array:
    memory = np.zeros(f.shape)
    for i in range(1, x.n):
        memory[:, i] = s["kept"] * memory[:, i - 1] + (1 - s["kept"]) * f[:, i - 1]
    return p * memory / GRAVITY


def _telegraph(f: Array, s: Drawn, x: Session) -> Array:
    changes = np.random.default_rng(int(s["seed"])).random(x.n) < 0.25
    return np.asarray(np.cumsum(changes) % 2, dtype=float)


def _chirp(f: Array, s: Drawn, x: Session) -> Array:
    turns = s["first"] * x.part + s["more"] * x.part**2
    return np.sin(TURN * turns + s["phase"])


def _room_magnet(f: Array, s: Drawn, x: Session) -> Array:
    return flange_force(x.joints, x.yaw, np.array([np.cos(s["dip"]), 0.0, np.sin(s["dip"])]))


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
    factor("cabinet_cycle", "time", "reading", _cycle,
           between(cycles=(1.2, 3.0), phase=(0.0, 6.3))),
    # No place: several coordinates at once, a memory, chance, or another target.
    Kind("triple_product", "output", 1e-3,
         lambda p, f, s, x: p * np.prod(f, axis=-1, keepdims=True) / GRAVITY**2),
    Kind("warm_square", "output", 3e-5, lambda p, f, s, x: p * x.warmth() * f * f / GRAVITY, WARM),
    # Each hour the cable gets tighter, and pulls at the housing as it is wound.
    factor("tightening_cable", "", "bias", lambda f, s, x: x.part * x.yaw / np.pi, needs=TIMED),
    # The remains of the step before the last one.
    Kind("sticking", "output", 2e-3, lambda p, f, s, x: p * before(np.sign(steps_of(f)))),
    # A glue that yields: each hold before has a part in what it remembers.
    Kind("creep", "output", 5e-3, _creep, settings=between(kept=(0.5, 0.85))),
    # The mounting was adjusted at the mean vibration.
    Kind("shaken_mounting", "mounting", 1e-3,
         lambda p, f, s, x: p * (x.vibration**2 - np.mean(x.vibration**2))[:, None], SHAKEN),
    # A trap in the oxide is full or empty; it changes between two holds in one of four cases.
    factor("telegraph_noise", "", "bias", _telegraph, SEED),
    # Two clocks of which one warms up beat faster and faster.
    factor("chirp", "", "bias", _chirp, CHIRP, TIMED),
    # A magnetic field that dips into the ground.
    factor("room_magnet", "", "bias", _room_magnet, between(dip=(0.8, 1.3))),
)  # fmt: skip
"""Name -> kind."""


# --- unforeseen -----------------------------------------------------------------------------------

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


def _thermal_loop(f: Array, s: Drawn, x: Session) -> Array:
    return np.tanh(x.rate) * 4 * x.part_of_range * (1 - x.part_of_range)


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
    factor("sunlit_pier", "time", "tilt", _cycle, between(cycles=(0.6, 2.5), phase=(0.0, 6.3))),
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
    factor("thermal_loop", "", "bias", _thermal_loop, needs=WARMING),
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

NOWHERE: Mapping[str, Kind] = {**OUTSIDE, **UNFORESEEN}
"""Effects that are not in the catalogue, by name."""


def place_of(kind: str) -> Place | None:
    """Coordinate and target of an effect that is not in the catalogue, if it has a place."""
    return NOWHERE[kind].place if kind in NOWHERE else None

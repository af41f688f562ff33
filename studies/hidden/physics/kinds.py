"""Kinds of physics: a formula, what it changes, and how its settings are drawn.

`kinds.yaml` is the table of all of them: what the catalogue of effects knows, and what was never in
it. A formula is an expression of the parameters p (B, 1, k), the forces f (B, n, 3) along the axes,
the settings of the kind, and what is known of the holds: `COORDINATES` in columns, (n, 1), with the
functions of `VOCABULARY`. So a kind needs of a session what its formula names.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from types import CodeType
from typing import Any, NamedTuple

import numpy as np
import yaml

from studies.hidden.physics.designs import REFERENCE, Session
from studies.hidden.physics.geometry import GRAVITY, Array, flange_force

Place = tuple[str, str]  # coordinate and target of a function

_TABLE = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text("utf-8"))
OUTPUTS = tuple(_TABLE["sensor"])  # targets of the sensor
RIG = {target: np.zeros(of["k"]) for target, of in _TABLE["rig"].items()}  # ideal
OF_ROBOT = ("angle", "yaw", "move")
"""Coordinates that a campaign without the robot's angles does not have."""
STILL = 0.02  # m/s², a step between holds that is too small for any effect

# --- formulas -------------------------------------------------------------------------------------


def before(values: Array) -> Array:
    """Values (..., n, c) of the hold before each; of the first one, 0."""
    return np.concatenate([0 * values[..., :1, :], values[..., :-1, :]], axis=-2)


def after(values: Array) -> Array:
    """Values (..., n, c) of the hold after each; of the last one, its own."""
    return np.concatenate([values[..., 1:, :], values[..., -1:, :]], axis=-2)


def moves(values: Array) -> Array:
    """Changes of values (..., n, c) from the hold before each; of the first one, 0."""
    return np.diff(values, axis=-2, prepend=values[..., :1, :])


def steps(f: Array) -> Array:
    """Changes of forces (B, n, 3) from hold to hold; of those that keep still, 0."""
    return np.where(abs(moves(f)) < STILL, 0.0, moves(f))


def memory(f: Array, kept: float) -> Array:
    """What is left of the forces (B, n, 3) of all holds before, of which each keeps a share."""
    left: Array = np.zeros(f.shape)
    for i in range(1, f.shape[1]):
        left[:, i] = kept * left[:, i - 1] + (1 - kept) * f[:, i - 1]
    return left


def beside(*columns: Array) -> Array:
    """Join columns (..., 1)."""
    return np.concatenate(np.broadcast_arrays(*columns), axis=-1)


def flips(seed: float, n: int) -> Array:
    """Of n holds 0 or 1, which changes in one of four, (n, 1)."""
    return np.asarray(np.cumsum(np.random.default_rng(int(seed)).random(n) < 0.25)[:, None] % 2.0)


def stays(seed: float, n: int) -> Array:
    """Of n holds −1, 0 or 1, which stays for two to five, (n, 1)."""
    rng = np.random.default_rng(int(seed))
    return np.asarray(1.0 * np.repeat(rng.integers(-1, 2, n), rng.integers(2, 6, n))[:n, None])


def walk(seed: float, part: Array) -> Array:
    """Random walk over parts of a session."""
    way = np.cumsum(np.random.default_rng(int(seed)).standard_normal(24))
    return np.interp(part, np.linspace(-0.1, 1.2, 24), way - way.mean())


TURN = 2 * np.pi
VOCABULARY: dict[str, Any] = {
    **vars(np),
    **{f.__name__: f for f in (before, after, moves, steps, memory, beside, flips, stays, walk,
                               flange_force)},
    "g": GRAVITY,
    "TURN": TURN,
    "next_axis": lambda f: np.roll(f, -1, axis=-1),
    "last_axis": lambda f: np.roll(f, 1, axis=-1),
    "prod": lambda f: np.prod(f, axis=-1, keepdims=True),
    "centred": lambda values: values - values.mean(axis=0),
}  # fmt: skip
"""What a formula may use of whatever session: NumPy's functions, and these."""
COORDINATES: Mapping[str, tuple[str, Callable[[Any], Any]]] = {
    "n": ("", lambda x: x.n),
    "number": ("", lambda x: np.arange(x.n)),
    "joints": ("", lambda x: x.joints),
    "roll": ("", lambda x: x.joints[:, 0]),
    "pitch": ("", lambda x: x.joints[:, 1]),
    "yaw": ("", lambda x: x.yaw),
    # Way that the joints, yaw included, have moved to each hold, rad; 0 for the first.
    "way": ("", lambda x: abs(moves(np.column_stack([x.joints, x.yaw]))).sum(axis=1)),
    "clock": ("", lambda x: x.clock),
    "duration": ("", lambda x: x.duration),
    "time": ("time", lambda x: x.time),
    "part": ("time", lambda x: x.time / x.duration),
    "vibration": ("vibration", lambda x: x.vibration),
    "shaking": ("vibration", lambda x: x.vibration / x.vibration.mean()),
    # Temperature above `REFERENCE` of a body with a lag of so many seconds, K.
    "warmth": ("temperature",
               lambda x: lambda tau=0.0: x.course.lagged(x.time, tau)[:, None] - REFERENCE),
    # Temperature over the range of the session, from its least or that at the start.
    "in_range": ("temperature",
                 lambda x: (x.temperature - x.course.values.min()) / np.ptp(x.course.values)),
    "since_start": ("temperature",
                    lambda x: (x.temperature - x.course.values[0]) / np.ptp(x.course.values)),
    "rate": ("warming", lambda x: x.warming * 600),  # K per 10 min
}  # fmt: skip
"""What a formula may use of a session -> the attribute that this takes, and how it is found."""

# --- settings -------------------------------------------------------------------------------------


class Setting(NamedTuple):
    """A setting of a kind: a random draw, and a grid that covers all there may be."""

    draw: Callable[[Session, np.random.Generator], float]
    grid: Callable[[Session], Sequence[float]] = lambda x: ()


FEWEST = 3  # least number of holds on either side of a sudden change


def _between_holds(x: Session, i: int, part: float) -> float:
    """Time when hold i (from 0) is over and the next has not begun."""
    low, high = x.clock[i], x.clock[i + 1]
    pause = 0.0 if x.time is None else min(x.length, 0.9 * (high - low))
    return float(low + pause / 2 + part * (high - low - pause))


def _moment(x: Session, rng: np.random.Generator) -> float:
    i = int(rng.integers(FEWEST - 1, x.n - FEWEST))
    return _between_holds(x, i, rng.uniform(0.1, 0.9))


SETTINGS = {
    "phase": Setting(lambda x, rng: rng.uniform(0, TURN)),
    "seed": Setting(lambda x, rng: float(rng.integers(1 << 31))),  # of what is random in itself
    "hold": Setting(lambda x, rng: float(rng.integers(x.n))),
    "moment": Setting(_moment, lambda x: [_between_holds(x, i, 0.5) for i in range(1, x.n - 2)]),
    "decay": Setting(
        lambda x, rng: x.duration * float(np.exp(rng.uniform(np.log(0.06), np.log(0.8)))),
        lambda x: [x.duration * float(part) for part in np.geomspace(0.05, 1.0, 9)],
    ),
    "knee": Setting(
        lambda x, rng: GRAVITY * rng.uniform(0.55, 0.93),
        lambda x: [GRAVITY * float(part) for part in np.arange(0.525, 0.98, 0.05)],
    ),
    "lag": Setting(
        lambda x, rng: x.duration * rng.uniform(0.05, 0.33) if rng.random() < 0.5 else 0.0,
        lambda x: [x.duration * part for part in (0.0, 0.04, 0.08, 0.14, 0.2, 0.27, 0.34)],
    ),
}
"""Settings by the names that the table has for them."""


def setting(said: str | list[float] | dict[str, list[float]]) -> Setting:
    """Setting of the table: a name, two bounds, or values."""
    if isinstance(said, str):
        return SETTINGS[said]
    if isinstance(said, list):
        low, high = said
        return Setting(lambda x, rng: rng.uniform(low, high))
    values = said["one of"]
    return Setting(lambda x, rng: float(rng.choice(values)), lambda x: values)


# --- kinds ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Kind:
    """One kind of physics.

    Attributes
    ----------
    name : str, canonical, if the catalogue has it
    target : str, of the sensor (`OUTPUTS`) or the rig (`RIG`)
    change : str, the formula, which gives the change of the target
    k : int, number of parameters
    typical : float, usual size of a parameter, SI
    settings : mapping of str to Setting
    of : str, if it is a function of one coordinate of the holds, which; empty else
    """

    name: str
    target: str
    change: str
    k: int
    typical: float
    settings: Mapping[str, Setting]
    of: str = ""

    @cached_property
    def code(self) -> CodeType:
        """The formula, to be evaluated."""
        return compile(self.change, self.name, "eval")

    @property
    def place(self) -> Place | None:
        """Coordinate and target; to turn the flange is to misread the joints."""
        target = "reading" if self.target == "deflection" else self.target
        return (self.of, target) if self.of else None

    def shows(self, session: Session) -> bool:
        """Whether a session has what it needs."""
        return all(getattr(session, name) is not None for name in self.needs)

    @property
    def needs(self) -> set[str]:
        """Attributes of a session without which it does not exist."""
        named = {COORDINATES[one][0] for one in self.code.co_names if one in COORDINATES}
        return named - {""}

    def draw(self, session: Session, rng: np.random.Generator) -> dict[str, float]:
        """Draw its settings."""
        return {name: one.draw(session, rng) for name, one in self.settings.items()}

    def grid(self, session: Session) -> list[dict[str, float]]:
        """Settings that cover all there may be."""
        grids = (one.grid(session) for one in self.settings.values())
        return [dict(zip(self.settings, values, strict=True)) for values in product(*grids)]


@dataclass(frozen=True)
class Cause:
    """A kind with its settings and a batch of its parameters (B, k).

    Attributes
    ----------
    lam : float, noncentrality; 0 for one of usual size, however little of it shows
    same : tuple of str, names of the catalogue that mean the same
    """

    kind: Kind
    settings: dict[str, float]
    parameters: Array
    lam: float = 0.0
    same: tuple[str, ...] = ()

    def change(self, force: Array | None, session: Session) -> Array:
        """What it adds to its target."""
        names: dict[str, Any] = {"p": self.parameters[:, None, :], "f": force, **self.settings}
        for name in {*self.kind.code.co_names} & {*COORDINATES}:
            value = COORDINATES[name][1](session)
            names[name] = value[:, None] if np.ndim(value) == 1 else value
        return np.asarray(eval(self.kind.code, VOCABULARY, names))


def _kinds(group: str) -> dict[str, Kind]:
    kinds, targets = {}, _TABLE["sensor"] | _TABLE["rig"]
    for name, entry in _TABLE[group].items():
        settings = {key: setting(said) for key, said in entry.get("settings", {}).items()}
        kinds[name] = Kind(name, **targets[entry["target"]] | entry | {"settings": settings})
    return kinds


EFFECTS, GROSS_EFFECTS = _kinds("catalogue"), _kinds("gross")  # what the catalogue knows
OUTSIDE, UNFORESEEN = _kinds("outside"), _kinds("unforeseen")
NOWHERE: Mapping[str, Kind] = {**OUTSIDE, **UNFORESEEN}  # not in the catalogue

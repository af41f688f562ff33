"""What a kind of physics is: a function, what it changes, what it needs, and how it is drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from studies.hidden.physics.designs import GRAVITY, Array, Session

Place = tuple[str, str]
"""Coordinate and target of a function."""

OUTPUTS = ("output", "clipping")
"""Targets of the sensor: what its output gains, by the force along its axes or by the output."""
RIG: Mapping[str, Array | float] = {
    "gravity": 0.0,
    "tilt": np.zeros(3),
    "skew": 0.0,
    "deflection": 0.0,
    "mounting": np.zeros(3),
    "reading": 0.0,
}
"""Targets of the rig, as in an ideal one: gravity less the stated one, m/s²; rotation of the base
(B, n, 3); turn of the roll axis against the pitch axis (B, n); attitude of the flange less that of
the joints (B, n, 2); rotation of the sensor on it (B, n, 3); errors of the encoders (B, n, 2)."""
COUNTS = {"output": 3, "clipping": 3, "gravity": 1, "tilt": 2, "skew": 1, "deflection": 2,
          "mounting": 3, "reading": 2}  # fmt: skip
"""Target -> its number of parameters, where a kind has no other."""


@dataclass(frozen=True)
class Settings:
    """Settings of a kind: a random draw, and a grid that covers all there may be."""

    draw: Callable[[Session, np.random.Generator], dict[str, float]] = lambda x, rng: {}
    grid: Callable[[Session], list[dict[str, float]]] = lambda x: [{}]


@dataclass(frozen=True)
class Kind:
    """One kind of physics.

    Attributes
    ----------
    name : str, canonical, if the catalogue has it
    target : str, of `OUTPUTS` or `RIG`
    typical : float, usual size of a parameter, SI
    function : change of the target by parameters p (B, 1, k), forces f (B, n, 3), settings s and
        the session x
    needs : attributes of a session without which it does not exist
    settings : Settings
    place : coordinate and target, if it is a function of one coordinate that changes one `FACTORS`
    count : int, number of parameters k
    """

    name: str
    target: str
    typical: float
    function: Callable[..., Array]
    needs: tuple[str, ...] = ()
    settings: Settings = Settings()
    place: Place | None = None
    count: int = 0

    @property
    def k(self) -> int:
        """Number of parameters."""
        return self.count or COUNTS[self.target]

    def shows(self, session: Session) -> bool:
        """Whether a session has what it needs."""
        return all(getattr(session, name) is not None for name in self.needs)

    def has_place(self, robot: bool) -> bool:
        """Whether it has a place whose coordinate a campaign records, with the robot or without."""
        return self.place is not None and (robot or self.place[0] not in OF_ROBOT)


@dataclass(frozen=True)
class Cause:
    """A kind with its settings and a batch of its parameters (B, k)."""

    kind: Kind
    settings: dict[str, float]
    parameters: Array

    def change(self, force: Array | None, session: Session) -> Array:
        """What it adds to its target."""
        return self.kind.function(self.parameters[:, None, :], force, self.settings, session)


def table(*kinds: Kind) -> dict[str, Kind]:
    """Kinds by name."""
    return {kind.name: kind for kind in kinds}


# --- functions of one coordinate ------------------------------------------------------------------

COORDINATES: Mapping[str, tuple[str, ...]] = {
    "force": (),
    "angle": (),
    "yaw": (),
    "vibration": ("vibration",),
    "temperature": ("course",),
    "time": ("time",),
    "previous": (),
    "next": (),
    "move": (),
    "dT/dt": ("warming",),
}
"""Coordinate -> attributes of a session without which it does not exist."""
OF_ROBOT = ("angle", "yaw", "move")
"""Coordinates that a campaign without the robot's angles does not have."""
FACTORS: Mapping[str, tuple[str, float, Callable[[Array, Array, Array], Array]]] = {
    "bias": ("output", 5e-3, lambda p, f, h: p * h + np.zeros(f.shape)),
    "scale": ("output", 5e-4, lambda p, f, h: p * h * f),
    "tilt": ("tilt", 5e-4, lambda p, f, h: tilted(p * h)),
    "reading": ("reading", 2e-4, lambda p, f, h: p * h),
}
"""Target of a function h of about 1 -> what it is in the rig, usual size, and the change."""


def tilted(p: Array) -> Array:
    """Rotations (B, n, 3) by which the base sees g (a, b, −1) for g (0, 0, −1), of a and b."""
    return np.stack([p[..., 1], -p[..., 0], np.zeros(p.shape[:-1])], axis=-1)


def factor(
    name: str,
    coordinate: str,
    target: str,
    h: Callable[..., Array],
    settings: Settings = Settings(),
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
    needs = needs or COORDINATES.get(coordinate, ())
    return Kind(name, of_rig, typical, function, needs, settings, place)


# --- forces ---------------------------------------------------------------------------------------

STILL = 0.02
"""m/s², a step between holds that is too small for any effect."""


def steps_of(f: Array) -> Array:
    """Steps from hold to hold of forces (B, n, 3); of those that keep still, 0."""
    step = np.zeros(f.shape)
    step[:, 1:] = f[:, 1:] - f[:, :-1]
    step[abs(step) < STILL] = 0
    return step


def before(values: Array) -> Array:
    """Values (B, n, 3) of the hold before each; of the first one, 0."""
    moved = np.zeros(values.shape)
    moved[:, 1:] = values[:, :-1]
    return moved


# --- settings -------------------------------------------------------------------------------------

FEWEST = 3
"""Least number of holds on either side of a sudden change."""
TURN = 2 * np.pi


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

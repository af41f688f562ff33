"""Effects outside the catalogue, by their place: a function of what changes what.

Most of them are a function of one *coordinate* of the holds, such as the yaw, that changes one
*target*, such as the bias. That is their true place. Some are a function of no coordinate, of two
at once, or change something else: they have no place.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studies.hidden.physics.designs import Course, Session
from studies.hidden.physics.effects import (
    Draw,
    Effect,
    Rig,
    RigAction,
    SensorAction,
    Settings,
    column,
)

Array = NDArray[np.float64]
Place = tuple[str, str]
"""Coordinate and target."""

NEEDS: Mapping[str, tuple[str, ...]] = {
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
TARGETS: Mapping[str, tuple[int, float]] = {
    "bias": (3, 5e-3),
    "scale": (3, 5e-4),
    "tilt": (2, 5e-4),
    "reading": (2, 2e-4),
}
"""Target -> its number of parameters and their usual size, SI."""


@dataclass(frozen=True)
class Outside(Effect):
    """An effect outside the catalogue.

    Attributes
    ----------
    place : (str, str), coordinate and target; None if it is not a function of one coordinate that
        changes one of `TARGETS`
    """

    place: Place | None = None

    def has_place(self, robot: bool) -> bool:
        """Whether it has a place whose coordinate a campaign records, with the robot or without."""
        return self.place is not None and (robot or self.place[0] not in OF_ROBOT)


OfHold = Callable[[Session, Settings], Array]
"""A function of a coordinate of the holds, (n,)."""
OfForce = Callable[[Array, Settings], Array]
"""A function of the forces of the holds, (B, n, 3) as they are."""


def of_bias(h: OfHold) -> SensorAction:
    """What a function of about 1 does to the bias of each axis."""
    return lambda f, p, s, session: p * h(session, s)[:, None] + np.zeros(f.shape)


def _of_scale(h: OfHold) -> SensorAction:
    return lambda f, p, s, session: p * h(session, s)[:, None] * f


def _of_tilt(h: OfHold) -> RigAction:
    def lean(rig: Rig, p: Array, s: Settings, session: Session) -> None:
        turn = np.zeros((len(p), session.n, 3))
        turn[..., 0] = p[..., 1] * h(session, s)
        turn[..., 1] = -p[..., 0] * h(session, s)
        rig.tilt = rig.tilt + turn

    return lean


def _of_reading(h: OfHold) -> RigAction:
    def misread(rig: Rig, p: Array, s: Settings, session: Session) -> None:
        rig.reading = rig.reading + p * h(session, s)[:, None]

    return misread


def no_settings(session: Session, rng: np.random.Generator) -> dict[str, float]:
    """Nothing to draw."""
    return {}


def of_hold(name: str, place: Place, h: OfHold, draw: Draw = no_settings) -> Outside:
    """An effect by a function of a coordinate of the holds, of about 1."""
    coordinate, target = place
    k, typical = TARGETS[target]
    sensor = {"bias": of_bias, "scale": _of_scale}.get(target)
    rig = {"tilt": _of_tilt, "reading": _of_reading}.get(target)
    return Outside(
        name,
        k,
        typical,
        rig=rig(h) if rig else None,
        sensor=sensor(h) if sensor else None,
        needs=NEEDS[coordinate],
        in_time=coordinate in ("time", "temperature", "dT/dt"),
        draw=draw,
        place=place,
    )


def of_force(name: str, place: Place, h: OfForce, draw: Draw = no_settings) -> Outside:
    """An effect on the bias or scale by a function of the forces of the holds, of about 1."""
    power = {"bias": 0, "scale": 1}[place[1]]

    def act(f: Array, p: Array, s: Settings, session: Session) -> Array:
        return p * h(f, s) * f**power

    return Outside(name, *TARGETS[place[1]], sensor=act, draw=draw, place=place)


def vibration(session: Session) -> Array:
    """Vibration of the holds over its mean, (n,)."""
    values = column(session.vibration)[:, 0]
    return values / values.mean()


def part_of_range(session: Session) -> Array:
    """Temperature of the holds as a part of the range of the session, 0 to 1, (n,)."""
    values = _course(session).values
    return (column(session.temperature)[:, 0] - values.min()) / np.ptp(values)


def since_start(session: Session) -> Array:
    """Temperature of the holds less that at the start, over the range of the session, (n,)."""
    values = _course(session).values
    return (column(session.temperature)[:, 0] - values[0]) / np.ptp(values)


def _course(session: Session) -> Course:
    if session.course is None:
        raise ValueError(f"{session.name}: has no temperature")
    return session.course


def warming(session: Session) -> Array:
    """Rate of the temperature of the holds, in K per 10 min, (n,)."""
    return column(session.warming)[:, 0] * 600


def parted(session: Session) -> Array:
    """Time of the holds as a part of the length of the session, (n,)."""
    return session.clock / session.duration


def cycle(session: Session, s: Settings) -> Array:
    """Some cycles over the session, zero at its start, (n,)."""
    angle = 2 * np.pi * parted(session) * s["cycles"]
    return np.sin(angle + s["phase"]) - np.sin(s["phase"])


def before(values: Array) -> Array:
    """Values (B, n, 3) of the hold before each; of the first one, 0."""
    moved = np.zeros(values.shape)
    moved[:, 1:] = values[:, :-1]
    return moved


def any_phase(session: Session, rng: np.random.Generator) -> dict[str, float]:
    """A phase."""
    return {"phase": rng.uniform(0, 2 * np.pi)}


def any_cycle(*orders: float) -> Draw:
    """A number of cycles per turn among some, with a phase."""
    return lambda session, rng: {
        "order": float(rng.choice(orders)),
        "phase": rng.uniform(0, 2 * np.pi),
    }


def between(**ranges: tuple[float, float]) -> Draw:
    """Settings, each evenly between two bounds."""
    return lambda session, rng: {name: rng.uniform(*ends) for name, ends in ranges.items()}


def any_seed(session: Session, rng: np.random.Generator) -> dict[str, float]:
    """A seed of what is random in itself."""
    return {"seed": float(rng.integers(1 << 31))}

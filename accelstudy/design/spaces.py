"""The attitudes that positions may have: all or some of them, and what constrains them."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import GON, attitude_unit, to_attitude
from accelstudy.leveling.angles import angles_of, specific_force
from accelstudy.positions.points import corners, edges, evenly_spread, faces
from accelstudy.schemes import get_scheme

TOLERANCE = 1e-7
"""rad, by which rounding may break a constraint."""


@dataclass(frozen=True, eq=False)
class Attitudes:
    """Attitudes to choose from, as directions of gravity in the body frame; angles in rad.

    Attributes
    ----------
    text : str, for people
    points : (k, 3) array of unit vectors; None for all attitudes
    roll, pitch : (least, most); None where there is no limit
    pole_distance : float, least angle between the x axis and the vertical, where roll is undefined
    """

    text: str = "all attitudes"
    points: Array | None = None
    roll: tuple[float, float] | None = None
    pitch: tuple[float, float] | None = None
    pole_distance: float | None = None

    def __post_init__(self) -> None:
        for name in ("roll", "pitch"):
            ends = getattr(self, name)
            if ends and not ends[0] < ends[1]:
                raise InputError(f"{name}: the first angle must be less than the second")

    @property
    def constraints(self) -> list[str]:
        """All constraints, for people."""
        texts = [
            f"{name} from {_angle_text(ends[0])} to {_angle_text(ends[1])}"
            for name in ("roll", "pitch")
            if (ends := getattr(self, name))
        ]
        if self.pole_distance is not None:
            texts.append(f"at least {_angle_text(self.pole_distance)} from the roll pole")
        return texts

    @cached_property
    def limits(self) -> tuple[Array, Array]:
        """Least and largest roll and pitch, (2,) each."""
        # Beyond the pole another roll begins; without limits of it, positions may move across.
        free = self.roll is None and self.pole_distance is None
        steepest = np.inf if free else np.pi / 2 - (self.pole_distance or 0.0)
        ends = np.array([self.roll or (-np.inf, np.inf), self.pitch or (-np.inf, np.inf)])
        ends[1] = np.maximum(ends[1, 0], -steepest), np.minimum(ends[1, 1], steepest)
        return ends[:, 0], ends[:, 1]

    def sample(self, count: int) -> Array:
        """Allowed attitudes: all of a finite set, else about `count`, evenly spread."""
        if self.points is not None:
            return self._within(self.points)
        allowed = self._within(evenly_spread(count))
        if 0 < len(allowed) < count / 2:
            allowed = self._within(evenly_spread(min(9999, count * count // len(allowed))))
        return allowed

    def _within(self, directions: Array) -> Array:
        low, high = self.limits
        angles = angles_to(directions)
        inside = (angles >= low - TOLERANCE) & (angles <= high + TOLERANCE)
        return directions[inside.all(axis=1)]


def cube() -> Attitudes:
    """Attitudes of a cube on a table: on its faces, edges and corners."""
    points = np.vstack([faces(), edges(), corners()])
    return Attitudes("a cube: 6 faces, 12 edges, 8 corners", _unit(points))


def attitudes_by_eye(step: float) -> Attitudes:
    """Attitudes that a person can judge by eye: roll and pitch in whole steps, rad."""
    turns = max(1, round(np.pi / 2 / step))
    rolls = np.arange(4 * turns) * np.pi / 2 / turns
    pitches = np.arange(-turns + 1, turns) * np.pi / 2 / turns
    points = [directions_at(np.array([r, p])) for p in pitches for r in rolls]
    return Attitudes(
        f"a block held by hand: roll and pitch in steps of {np.degrees(np.pi / 2 / turns):g}°",
        _unit(np.array([*points, [1.0, 0, 0], [-1.0, 0, 0]])),
    )


NAMED: dict[str, Callable[[], Attitudes]] = {
    "all": Attitudes,
    "cube": cube,
    "hand": partial(attitudes_by_eye, np.pi / 6),
    "grid": partial(attitudes_by_eye, 25 * GON),
}
"""Sets of attitudes; steps of 30° are judged by eye, those of 25 gon are for a robot."""
SPACES = ("all", "cube", "hand")
"""Sets that a design chooses from."""


def find_attitudes(name: str, names: Collection[str]) -> Attitudes:
    """Attitudes by their name, one of some of `NAMED`, or those of a scheme.

    Raises
    ------
    InputError
        If there is no such set, or the file of the scheme cannot be read.
    """
    if name in names:
        return NAMED[name]()
    try:
        scheme = get_scheme(name)
    except UnknownNameError:
        raise UnknownNameError("set of attitudes", name, (*names, "a scheme")) from None
    points = np.unique(scheme.directions.round(12), axis=0)
    return Attitudes(f"{len(points)} attitudes of {scheme.name}", _unit(points))


def angles_to(directions: Array) -> Array:
    """Roll and pitch, rad, (..., 2), of directions of gravity."""
    return angles_of(-np.asarray(directions))


def directions_at(angles: Array) -> Array:
    """Directions of gravity, (..., 3), at roll and pitch (..., 2), rad."""
    return -np.stack(specific_force(angles[..., 0], angles[..., 1], 1.0), axis=-1)


def _unit(points: Array) -> Array:
    return np.asarray(points / np.linalg.norm(points, axis=-1, keepdims=True))


def _angle_text(angle: float) -> str:
    return f"{float(to_attitude(angle)):.6g} {attitude_unit()}"

"""The attitudes to choose from: where they lie, how they can move, and what constrains them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from io import StringIO
from itertools import combinations, product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import ANGLE_UNITS, attitude_unit, to_attitude, to_si
from accelstudy.basics.wording import short_list
from accelstudy.files.reading import read_text
from accelstudy.leveling.angles import angles_of, specific_force
from accelstudy.positions.points import corners, edges, evenly_spread, faces

Array = NDArray[np.float64]

MOST_MOUNTINGS = 150
"""Number of choices of mountings that are tried; of more, a random part."""


class Space(ABC):
    """A set of attitudes, as directions of gravity in the body frame.

    Attributes
    ----------
    text : str, for people
    """

    text: str

    @abstractmethod
    def directions(self, count: int) -> Array:
        """Attitudes of the set, (k, 3): all of a finite set, else about `count`, evenly spread."""

    def tangents(self, directions: Array) -> Array:
        """Unit vectors along which positions (n, 3) can move, (n, 3, d); d = 0 of a finite set."""
        return np.zeros((len(directions), 3, 0))

    def parts(self, rng: np.random.Generator) -> list[Space]:
        """Parts of the set, of which one is to be chosen; often only the set itself."""
        return [self]


class Sphere(Space):
    """All attitudes."""

    text = "all attitudes"

    def directions(self, count: int) -> Array:
        """Points of the Fibonacci lattice."""
        return evenly_spread(count)

    def tangents(self, directions: Array) -> Array:
        """Return two directions across gravity."""
        away = np.eye(3)[np.argmin(np.abs(directions), axis=1)]
        first = np.cross(directions, away)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        return np.stack([first, np.cross(directions, first)], axis=-1)


@dataclass(frozen=True, eq=False)
class FiniteSet(Space):
    """A finite set of attitudes.

    Attributes
    ----------
    points : (k, 3) array of unit vectors
    """

    points: Array
    text: str

    def directions(self, count: int) -> Array:
        """All of them."""
        return self.points


def cube() -> FiniteSet:
    """Attitudes of a cube on a table: on its faces, edges and corners."""
    points = np.vstack([faces(), edges(), corners()])
    return FiniteSet(_unit(points), "a cube: 6 faces, 12 edges, 8 corners")


def attitudes_by_eye(step: float) -> FiniteSet:
    """Attitudes that a person can judge by eye: roll and pitch in whole steps, rad."""
    turns = max(1, round(np.pi / 2 / step))
    rolls = np.arange(4 * turns) * np.pi / 2 / turns
    pitches = np.arange(-turns + 1, turns) * np.pi / 2 / turns
    points = [-np.array(specific_force(r, p, 1.0, np)) for p in pitches for r in rolls]
    return FiniteSet(
        _unit(np.array([*points, [1.0, 0, 0], [-1.0, 0, 0]])),
        f"a block held by hand: roll and pitch in steps of {np.degrees(np.pi / 2 / turns):g}°",
    )


@dataclass(frozen=True)
class Mountings(Space):
    """Turns about one horizontal axis per mounting of the sensor: circles about its axes.

    Attributes
    ----------
    count : int, mountings
    axes : tuple of axes in the sensor to choose from; by default x, y, z and their bisectors
    """

    count: int
    axes: tuple[tuple[float, float, float], ...] = tuple(
        (float(x), float(y), float(z))
        for x, y, z in product((1, 0, -1), repeat=3)
        if (x, y, z) > (0, 0, 0) and abs(x) + abs(y) + abs(z) <= 2
    )

    @property
    def text(self) -> str:  # type: ignore[override]
        """How many of them."""
        one = self.count == 1
        return f"{self.count} {'mounting' if one else 'mountings, each'} turned about one axis"

    def directions(self, count: int) -> Array:
        """Even steps about each axis."""
        steps = max(8, count // len(self.axes))
        angle = 2 * np.pi * np.arange(steps) / steps
        circles = []
        for axis in _unit(np.array(self.axes)):
            one = Sphere().tangents(axis[None])[0]
            circles.append(np.cos(angle)[:, None] * one[:, 0] + np.sin(angle)[:, None] * one[:, 1])
        return np.vstack(circles)

    def mounting(self, directions: Array) -> NDArray[np.int_]:
        """Index of the axis, (n,), that is horizontal in each position."""
        return np.asarray(np.argmin(np.abs(directions @ _unit(np.array(self.axes)).T), axis=1))

    def tangents(self, directions: Array) -> Array:
        """Turn about the axis of the mounting."""
        axes = _unit(np.array(self.axes))[self.mounting(directions)]
        return _unit(np.cross(axes, directions))[..., None]

    def parts(self, rng: np.random.Generator) -> list[Space]:
        """Choices of as many axes as there are mountings."""
        chosen = list(combinations(self.axes, self.count))
        if len(chosen) > MOST_MOUNTINGS:
            keep = rng.choice(len(chosen), MOST_MOUNTINGS, replace=False)
            chosen = [chosen[i] for i in sorted(keep)]
        return [Mountings(self.count, axes) for axes in chosen]


def read_attitudes(path: Path) -> FiniteSet:
    """Read the attitudes of a CSV file.

    It has the columns x, y, z (directions of gravity in the body frame) or roll_U, pitch_U, where U
    is one of gon, deg and rad.

    Raises
    ------
    InputError
        If it cannot be read, or has neither.
    """
    import pandas as pd  # slow to import, and seldom needed

    try:
        table = pd.read_csv(StringIO(read_text(path)), comment="#", dtype=str)
    except InputError:
        raise
    except ValueError:
        raise InputError(f"{path}: is no CSV table") from None
    units = (*ANGLE_UNITS, "rad")
    pairs = [("x", "y", "z"), *((f"roll_{u}", f"pitch_{u}") for u in units)]
    columns = next((names for names in pairs if set(names) <= set(table.columns)), None)
    if columns is None:
        wanted = "; ".join(", ".join(names) for names in pairs)
        raise InputError(
            f"{path}: has the columns {short_list([*map(str, table.columns)])}; expected {wanted}"
        )
    values = table[list(columns)].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(bad):
        raise InputError(f"{path}: row {bad[0] + 1}: {', '.join(columns)} must be numbers")
    if len(columns) == 2:
        roll, pitch = to_si(values, columns[0].rpartition("_")[2], "rad").T
        values = -np.stack(specific_force(roll, pitch, 1.0, np), axis=-1)
    if not len(values) or not np.all(np.linalg.norm(values, axis=1) > 0):
        raise InputError(f"{path}: no attitudes in it, or a direction of length zero")
    points = np.unique(_unit(values).round(12), axis=0)
    return FiniteSet(_unit(points), f"{len(points)} attitudes of {path.name}")


def attitudes(directions: Array) -> Array:
    """Roll and pitch, rad, (n, 2), of directions of gravity."""
    return angles_of(-np.asarray(directions))


def _unit(points: Array) -> Array:
    return np.asarray(points / np.linalg.norm(points, axis=-1, keepdims=True))


TOLERANCE = 1e-7
"""rad, by which rounding may break a constraint."""


@dataclass(frozen=True)
class Constraints:
    """Constraints that positions must meet; rad, None where there is none.

    Attributes
    ----------
    roll, pitch : (least, most)
    pole_distance : float, least angle between the x axis and the vertical, where roll is undefined
    least_angle : float, between any two positions
    """

    roll: tuple[float, float] | None = None
    pitch: tuple[float, float] | None = None
    pole_distance: float | None = None
    least_angle: float | None = None

    def __post_init__(self) -> None:
        for name, (least, most) in self._ranges.items():
            if not least < most:
                raise InputError(f"{name}: the first angle must be less than the second")

    @property
    def _ranges(self) -> dict[str, tuple[float, float]]:
        """Ranges of angles by their names."""
        return {name: ends for name in ("roll", "pitch") if (ends := getattr(self, name))}

    @property
    def texts(self) -> list[str]:
        """All of them, for people."""
        texts = [
            f"{name} from {_angle_text(a)} to {_angle_text(b)}"
            for name, (a, b) in self._ranges.items()
        ]
        if self.pole_distance is not None:
            texts.append(f"at least {_angle_text(self.pole_distance)} from the roll pole")
        if self.least_angle is not None:
            texts.append(f"at least {_angle_text(self.least_angle)} between positions")
        return texts

    def allow(self, directions: Array) -> NDArray[np.bool_]:
        """Which of directions (n, 3) meet the constraints on single positions, (n,)."""
        allowed = np.ones(len(directions), dtype=bool)
        if self._ranges:
            angles = dict(zip(("roll", "pitch"), attitudes(directions).T, strict=True))
        for name, (least, most) in self._ranges.items():
            allowed &= (angles[name] >= least - TOLERANCE) & (angles[name] <= most + TOLERANCE)
        if self.pole_distance is not None:
            x, y, z = directions.T
            allowed &= np.arctan2(np.hypot(y, z), np.abs(x)) >= self.pole_distance - TOLERANCE
        return allowed

    def keep(self, directions: Array) -> Array:
        """Those of directions (n, 3) that meet the constraints on single positions."""
        return directions[self.allow(directions)]

    def are_apart(self, directions: Array, others: Array) -> NDArray[np.bool_]:
        """Which of k directions are far enough from all of the others, (k,)."""
        if self.least_angle is None or not len(others):
            return np.ones(len(directions), dtype=bool)
        limit = np.cos(self.least_angle - TOLERANCE)
        return np.asarray(np.all(directions @ others.T <= limit, axis=1))

    def are_met(self, directions: Array) -> bool:
        """Whether a set of positions meets all constraints."""
        allowed = bool(np.all(self.allow(directions)))
        if self.least_angle is None or not allowed:
            return allowed
        near = directions @ directions.T > np.cos(self.least_angle - TOLERANCE)
        np.fill_diagonal(near, False)
        return not near.any()


def _angle_text(angle: float) -> str:
    return f"{float(to_attitude(angle)):.6g} {attitude_unit()}"

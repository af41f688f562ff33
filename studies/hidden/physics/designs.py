"""The sessions of the study as they really are: attitudes, order, time, temperature, vibration."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import permutations, product
from typing import Any

import numpy as np

from accelstudy.basics.units import MGON
from studies.hidden.physics.geometry import GRAVITY, Array, joints_of, level_force, rotated

REFERENCE = 20.0  # °C, at which bias and scale have their stated values


@dataclass(frozen=True)
class Course:
    """A temperature that changes linearly between given times; before and after it is constant.

    Attributes
    ----------
    times : (k,) array, s
    values : (k,) array, °C
    """

    times: Array
    values: Array

    def at(self, time: Array) -> Array:
        """Temperature at times, °C."""
        return np.interp(time, self.times, self.values)

    def lagged(self, time: Array, tau: float) -> Array:
        """Temperature of a body that follows with a first-order lag of `tau` seconds, °C.

        Before the first time the body and what surrounds it are equally warm.
        """
        if tau == 0:
            return self.at(time)
        moments = np.union1d(self.times, time)
        outside = self.at(moments)
        # Behind a linear change a body lags, in the long run, by tau times the slope. Any other
        # difference decays.
        steps = np.diff(moments)
        back = tau * np.diff(outside) / steps
        decay = np.exp(-steps / tau)
        body = [float(outside[0])]
        for i, kept in enumerate(decay.tolist()):
            away = body[i] - (outside[i] - back[i])
            body.append(float(outside[i + 1] - back[i] + kept * away))
        return np.asarray(body)[np.searchsorted(moments, time)]


@dataclass(frozen=True)
class Session:
    """The holds of a session as they really are, whatever the sensor does.

    Attributes
    ----------
    name : str, of the design
    joints : (n, 2) array, rad, true angles of the roll and the pitch joint
    yaw : (n,) array, rad
    sigma : float, m/s², of a position mean
    sigma_angle : float, rad, of an encoder's reading
    n_samples : int, in a hold; 0 if nothing is known of the samples
    length : float, s, of a hold
    time : (n,) array, s, middles of the holds; None if they were not written down
    course : Course, of the temperature; None without a thermometer
    vibration : (n,) array, m/s²; None if it was not measured
    full_range : float, m/s², the sensor is stated to measure ± this; None if nothing is stated
    """

    name: str
    joints: Array
    yaw: Array
    sigma: float
    sigma_angle: float
    n_samples: int = 0
    length: float = 20.0
    time: Array | None = None
    course: Course | None = None
    vibration: Array | None = None
    full_range: float | None = None

    @property
    def n(self) -> int:
        """Number of holds."""
        return len(self.joints)

    @cached_property
    def temperature(self) -> Array | None:
        """Temperature in the middles of the holds, °C."""
        if self.course is None or self.time is None:
            return None
        return self.course.at(self.time)

    @cached_property
    def warming(self) -> Array | None:
        """Rate of the temperature in the holds, K/s; None where most of them have none."""
        if self.course is None or self.time is None:
            return None
        ends = (self.course.at(self.time + by) for by in (self.length / 2, -self.length / 2))
        change = np.subtract(*ends) / self.length
        return change if np.mean(change != 0) > 0.5 else None

    @cached_property
    def repeats(self) -> bool:
        """Whether a third of the holds, or more, repeat the attitude of another one."""
        directions = np.round(level_force(self.joints) / GRAVITY, 2)
        return len(np.unique(directions + 0.0, axis=0)) <= 2 * self.n / 3

    @cached_property
    def clock(self) -> Array:
        """Time of each hold, or its number where there is no time."""
        return np.arange(1.0, self.n + 1) if self.time is None else self.time

    @property
    def duration(self) -> float:
        """From the first hold to the last, as the clock has it."""
        return float(self.clock[-1] - self.clock[0])


ANGLE_SIGMA = 3.2 * MGON


def _spiral(count: int, rng: np.random.Generator) -> Array:
    """Directions spread evenly along a spiral from pole to pole, in any attitude."""
    height = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    radius = np.sqrt(1 - height**2)
    directions = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])
    return rotated(directions, rng.uniform(0.3, 1.5, 3))


def _snub_cube() -> Array:
    """The 24 corners of a snub cube: even permutations with even signs, and odd ones with odd."""
    t = (1 + np.cbrt(19 + 3 * np.sqrt(33)) + np.cbrt(19 - 3 * np.sqrt(33))) / 3
    corner = np.array([1.0, 1 / t, t]) / np.sqrt(1 + 1 / t**2 + t**2)
    ways = product(permutations(range(3)), product((1.0, -1.0), repeat=3))
    alike = (way for way in ways if np.linalg.det(np.eye(3)[[*way[0]]]) == np.prod(way[1]))
    return np.array([np.array(signs) * corner[[*order]] for order, signs in alike])


def _faces_and_edges() -> Array:
    """6 faces and 12 edges of a cube."""
    grid = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
    count = np.sum(grid != 0, axis=1)
    chosen = grid[(count == 1) | (count == 2)]
    return np.asarray(chosen / np.linalg.norm(chosen, axis=1, keepdims=True))


def _three_circles() -> Array:
    """Turns about each axis in eight steps of 45°, as a hand or one joint makes them."""
    angle = np.arange(8) * np.pi / 4
    circle = np.round(np.column_stack([np.cos(angle), np.sin(angle), np.zeros(8)]), 15)
    return np.asarray(np.concatenate([np.roll(circle, shift, axis=1) for shift in range(3)]))


def _by_hand(directions: Array, rng: np.random.Generator) -> Array:
    """Directions as a hand meets them, some degrees beside."""
    return rotated(directions, 0.03 * rng.standard_normal(directions.shape))


def _held(
    directions: Array,
    sigma: float,
    samples: int = 0,
    hold: float = 20.0,
    pause: float | None = None,
    wait: tuple[float, int] = (0.0, 1),
    warms: Callable[[Array], Array] | None = None,
    blocks: tuple[float, ...] = (),
    yaw: Array | None = None,
    **more: Any,
) -> Session:
    """Session of holds of so many seconds with pauses; without a pause no time was written down.

    `wait` is how long somebody waits between so many equal blocks of holds. The temperature is a
    function of the time, or one for each of the blocks, and changes between them.
    """
    n, time, course = len(directions), None, None
    if pause is not None:
        waited = wait[0] * np.repeat(np.arange(wait[1]), n // wait[1])
        time = hold / 2 + (hold + pause) * np.arange(n) + waited
        grid = np.linspace(0.0, time[-1] + 60.0, 200)
        if warms:
            course = Course(grid, warms(grid))
        if blocks:
            parts = np.array_split(time, wait[1])
            course = Course(np.ravel([part[[0, -1]] for part in parts]), np.repeat(blocks, 2))
    yaw = np.zeros(n) if yaw is None else yaw
    joints = joints_of(directions)
    return Session("", joints, yaw, sigma, ANGLE_SIGMA, samples, hold, time, course, **more)


def _there_and_back(rng: np.random.Generator) -> Array:
    """Twelve directions, the same back, and twice in another order."""
    one = rng.permutation(_spiral(12, rng))
    return np.concatenate([one, one[::-1], rng.permutation(one), rng.permutation(one)])


def _twice(rng: np.random.Generator) -> Array:
    """18 directions in two orders."""
    one = _spiral(18, rng)
    return np.concatenate([rng.permutation(one), rng.permutation(one)])


# Each draws the directions first.
_DESIGNS: dict[str, Callable[[np.random.Generator], Session]] = {
    "spread-24": lambda rng: _held(
        rng.permutation(_spiral(24, rng)), 0.002, 3000, 30.0, 20.0,
        warms=lambda t: 21 + 7 * (1 - np.exp(-t / 500)) + 0.6 * np.sin(t / 170)),
    "abba-48": lambda rng: _held(
        _there_and_back(rng), 0.001, 2000, 20.0, 20.0, (900.0, 4),
        blocks=(12.0, 34.0, 34.0, 12.0), yaw=rng.uniform(-np.pi, np.pi, 48)),
    "circles-24": lambda rng: _held(_three_circles(), 0.002, 500, 10.0, 15.0),
    "snub-24": lambda rng: _held(rng.permutation(_snub_cube()), 0.002),
    "hand-18": lambda rng: _held(
        _by_hand(_faces_and_edges(), rng), 0.003, 400, yaw=rng.uniform(-0.5, 0.5, 18)),
    "repeats-30": lambda rng: _held(
        rng.permutation(np.tile(_spiral(15, rng), (2, 1))), 0.0005, 6000, 60.0, 30.0,
        warms=lambda t: 24 - 3 * np.cos(2 * np.pi * t / 1900),
        yaw=rng.uniform(-np.pi, np.pi, 30), vibration=0.1 + 1.4 * rng.random(30) ** 2),
    "yaw-50": lambda rng: _held(
        rng.permutation(_spiral(50, rng)), 0.003, 1000, 15.0, 12.0,
        yaw=rng.uniform(-np.pi, np.pi, 50)),
    "long-60": lambda rng: _held(
        rng.permutation(np.tile(_by_hand(_spiral(20, rng), rng), (3, 1))), 0.005, 200, 20.0, 25.0,
        warms=lambda t: 30 - 9 * np.exp(-t / 700) + 2.5 * np.sin(t / 310),
        yaw=rng.uniform(-np.pi, np.pi, 60), vibration=0.2 + 2.0 * rng.random(60),
        full_range=19.6133),
    "two-warm-36": lambda rng: _held(
        _twice(rng), 0.002, 2500, 25.0, 10.0, (1200.0, 2), blocks=(21.0, 38.0)),
}  # fmt: skip

DESIGNS = tuple(_DESIGNS)
APPROACHES = ("gravity", "robot")


@cache
def session(design: str) -> Session:
    """The session of a design; the same whenever it is asked for."""
    made = _DESIGNS[design](np.random.default_rng(zlib.crc32(design.encode())))
    return replace(made, name=design)

"""The designs of the study: which attitudes, how often, in which order, when and how warm."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from functools import cache
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.units import MGON
from accelstudy.hidden.physics.forward.rotations import rotated
from accelstudy.hidden.physics.forward.session import Course, Session

Array = NDArray[np.float64]

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
    found = []
    for order in permutations(range(3)):
        parity = np.linalg.det(np.eye(3)[list(order)])
        for signs in product((1.0, -1.0), repeat=3):
            if np.prod(signs) == parity:
                found.append(np.array(signs) * corner[list(order)])
    return np.array(found)


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


def _joints(directions: Array) -> Array:
    """Roll and pitch of directions of the specific force (n, 3), rad."""
    x, y, z = directions.T + 0.0  # no negative zeros, for which roll would turn by half a turn
    return np.column_stack([np.arctan2(-y + 0.0, -z + 0.0), np.arctan2(x, np.hypot(y, z))])


def _by_hand(directions: Array, rng: np.random.Generator, sigma: float = 0.03) -> Array:
    """Directions as a hand meets them, some degrees beside."""
    aside: Array = sigma * rng.standard_normal(directions.shape)
    return rotated(directions, aside)


def _times(n: int, hold: float, pause: float) -> Array:
    return np.asarray(hold / 2 + (hold + pause) * np.arange(n), dtype=float)


def _blocks(time: Array, values: tuple[float, ...]) -> Course:
    """Equal blocks of holds, each at a temperature of its own, with the change between them."""
    blocks = np.array_split(time, len(values))
    edges = [edge for block in blocks for edge in (block[0], block[-1])]
    return Course(np.array(edges), np.repeat(values, 2))


def _smooth(time: Array, course: Callable[[Array], Array]) -> Course:
    grid = np.linspace(0.0, time[-1] + 60.0, 200)
    return Course(grid, course(grid))


def _spread_24(rng: np.random.Generator) -> Session:
    directions = rng.permutation(_spiral(24, rng))
    time = _times(24, 30.0, 20.0)
    course = _smooth(time, lambda t: 21 + 7 * (1 - np.exp(-t / 500)) + 0.6 * np.sin(t / 170))
    joints = _joints(directions)
    return Session(
        "spread-24", joints, np.zeros(24), 0.002, ANGLE_SIGMA, 3000, 30.0, time, course, slopes=True
    )


def _abba_48(rng: np.random.Generator) -> Session:
    one = rng.permutation(_spiral(12, rng))
    joints = _joints(np.concatenate([one, one[::-1], rng.permutation(one), rng.permutation(one)]))
    time = _times(48, 20.0, 20.0) + 900.0 * np.repeat(np.arange(4), 12)
    course = _blocks(time, (12.0, 34.0, 34.0, 12.0))
    yaw = rng.uniform(-np.pi, np.pi, 48)
    return Session(
        "abba-48", joints, yaw, 0.001, ANGLE_SIGMA, 2000, 20.0, time, course, slopes=True
    )


def _circles_24(rng: np.random.Generator) -> Session:
    joints = _joints(_three_circles())
    return Session(
        "circles-24", joints, np.zeros(24), 0.002, ANGLE_SIGMA, 500, 10.0, _times(24, 10.0, 15.0)
    )


def _snub_24(rng: np.random.Generator) -> Session:
    joints = _joints(rng.permutation(_snub_cube()))
    return Session("snub-24", joints, np.zeros(24), 0.002, ANGLE_SIGMA)


def _hand_18(rng: np.random.Generator) -> Session:
    joints = _joints(_by_hand(_faces_and_edges(), rng))
    return Session("hand-18", joints, rng.uniform(-0.5, 0.5, 18), 0.003, ANGLE_SIGMA, 400)


def _repeats_30(rng: np.random.Generator) -> Session:
    directions = rng.permutation(np.tile(_spiral(15, rng), (2, 1)))
    time = _times(30, 60.0, 30.0)
    course = _smooth(time, lambda t: 24 - 3 * np.cos(2 * np.pi * t / 1900))
    return Session(
        "repeats-30",
        _joints(directions),
        rng.uniform(-np.pi, np.pi, 30),
        0.0005,
        ANGLE_SIGMA,
        6000,
        60.0,
        time,
        course,
        vibration=0.1 + 1.4 * rng.random(30) ** 2,
        slopes=True,
    )


def _yaw_50(rng: np.random.Generator) -> Session:
    joints = _joints(rng.permutation(_spiral(50, rng)))
    yaw = rng.uniform(-np.pi, np.pi, 50)
    return Session(
        "yaw-50", joints, yaw, 0.003, ANGLE_SIGMA, 1000, 15.0, _times(50, 15.0, 12.0), slopes=True
    )


def _long_60(rng: np.random.Generator) -> Session:
    directions = rng.permutation(np.tile(_by_hand(_spiral(20, rng), rng), (3, 1)))
    time = _times(60, 20.0, 25.0)
    course = _smooth(time, lambda t: 30 - 9 * np.exp(-t / 700) + 2.5 * np.sin(t / 310))
    return Session(
        "long-60",
        _joints(directions),
        rng.uniform(-np.pi, np.pi, 60),
        0.005,
        ANGLE_SIGMA,
        200,
        20.0,
        time,
        course,
        vibration=0.2 + 2.0 * rng.random(60),
        full_range=19.6133,
    )


def _two_warm_36(rng: np.random.Generator) -> Session:
    one = _spiral(18, rng)
    joints = _joints(np.concatenate([rng.permutation(one), rng.permutation(one)]))
    time = _times(36, 25.0, 10.0) + 1200.0 * np.repeat(np.arange(2), 18)
    course = _blocks(time, (21.0, 38.0))
    return Session(
        "two-warm-36", joints, np.zeros(36), 0.002, ANGLE_SIGMA, 2500, 25.0, time, course
    )


_DESIGNS: dict[str, Callable[[np.random.Generator], Session]] = {
    "spread-24": _spread_24,
    "abba-48": _abba_48,
    "circles-24": _circles_24,
    "snub-24": _snub_24,
    "hand-18": _hand_18,
    "repeats-30": _repeats_30,
    "yaw-50": _yaw_50,
    "long-60": _long_60,
    "two-warm-36": _two_warm_36,
}

DESIGNS = tuple(_DESIGNS)
"""Names of the designs."""
APPROACHES = ("gravity", "robot")


@cache
def session(design: str) -> Session:
    """The session of a design; the same whenever it is asked for."""
    return _DESIGNS[design](np.random.default_rng(zlib.crc32(design.encode())))

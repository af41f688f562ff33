"""Axes by three letters: what they mean, and which letters mean nothing."""

from itertools import permutations, product

import numpy as np
import pytest

from accelstudy.sensors.frames import FRD, parse_frame

POINTS = {"f": [1, 0, 0], "r": [0, 1, 0], "d": [0, 0, 1]}
POINTS |= {"b": [-1, 0, 0], "l": [0, -1, 0], "u": [0, 0, -1]}
RIGHT_HANDED = [
    name
    for pairs in permutations(("fb", "rl", "du"))
    for name in map("".join, product(*pairs))
    if np.linalg.det([POINTS[letter] for letter in name]) > 0
]


@pytest.mark.parametrize("name", RIGHT_HANDED)
def test_frames(name):
    frame = parse_frame(name.upper())
    assert np.linalg.det(frame.matrix) == pytest.approx(1)
    for i, letter in enumerate(name):
        np.testing.assert_array_equal(frame.to_frd(np.eye(3)[i]), POINTS[letter])
    some = np.random.default_rng(1).normal(size=(5, 3))
    np.testing.assert_array_equal(frame.to_frd(some), some @ frame.matrix.T)
    np.testing.assert_array_equal(frame.from_frd(frame.to_frd(some)), some)


def test_well_known_frames():
    assert len(RIGHT_HANDED) == 24
    np.testing.assert_array_equal(FRD.matrix, np.eye(3))
    # At level a sensor reads +g upwards.
    for name, reading in {"frd": [0, 0, -9.8], "flu": [0, 0, 9.8], "urf": [9.8, 0, 0]}.items():
        np.testing.assert_array_equal(parse_frame(name).to_frd(reading), [0, 0, -9.8])
    # In ROS and on phones the pitch is about an axis to the left, or to the right.
    np.testing.assert_array_equal(parse_frame("flu").signs, [1, -1, -1])
    np.testing.assert_array_equal(parse_frame("rfu").signs, [1, 1, -1])
    np.testing.assert_array_equal(parse_frame("rfu").to_frd_order(np.array([1, 2, 3])), [2, 1, 3])

"""Leveling: equations (6) and (7) of Thalmann & Neuner (2018), and the accuracy they imply."""

from itertools import pairwise

import numpy as np
import pytest
from closed_forms import roll_and_pitch
from hypothesis import given
from hypothesis import strategies as st
from usual import G

from accelstudy.basics.units import GON
from accelstudy.leveling.angles import (
    jacobian,
    near_pole,
    roll_pitch,
    sigma_roll_pitch,
    specific_force,
    wrap_angle,
)

ROLLS = st.floats(-199 * GON, 199 * GON)
PITCHES = st.floats(-95 * GON, 95 * GON)


def force(roll, pitch):
    return np.array(specific_force(roll, pitch, G))


@given(roll=ROLLS, pitch=PITCHES)
def test_leveling_inverts_the_specific_force(roll, pitch):
    np.testing.assert_allclose(roll_pitch(tuple(force(roll, pitch))), [roll, pitch], atol=1e-12)


@pytest.mark.parametrize(("f", "roll", "pitch"), [
    ((0, 0, -G), 0, 0),  # level
    ((-0.0, -0.0, G), 200, 0),  # upside down
    ((0, -G, 0), 100, 0),  # on the right side
    ((0, G, 0), -100, 0),
    ((G, 0, 0), None, 100),  # nose up: no roll
    ((-G, 0, 0), None, -100),
    ((G * np.sin(10 * GON), 0, -G * np.cos(10 * GON)), 0, 10),
    ((0, -G * np.sin(30 * GON), -G * np.cos(30 * GON)), 30, 0),
])  # fmt: skip
def test_signs_of_the_convention(f, roll, pitch):
    """North-east-down: f_b = g (sin θ, −cos θ sin φ, −cos θ cos φ), in gon."""
    found = np.array(roll_pitch(f)) / GON
    assert found[1] == pytest.approx(pitch, abs=1e-12)
    if roll is not None:
        assert found[0] == pytest.approx(roll, abs=1e-12)
        np.testing.assert_allclose(force(roll * GON, pitch * GON), f, atol=1e-14 * G)


@given(roll=ROLLS, pitch=PITCHES)
def test_jacobian_is_equation_7(roll, pitch):
    f_x, f_y, f_z = f = force(roll, pitch)
    f_yz2 = f_y**2 + f_z**2
    f_yz, f_xyz2 = np.sqrt(f_yz2), f_x**2 + f_yz2
    expected = [
        [0, f_z / f_yz2, -f_y / f_yz2],
        [f_yz / f_xyz2, -f_x * f_y / (f_xyz2 * f_yz), -f_x * f_z / (f_xyz2 * f_yz)],
    ]
    np.testing.assert_allclose(jacobian(f), expected, rtol=1e-9, atol=1e-14)


@given(roll=ROLLS, pitch=PITCHES, sigma=st.floats(1e-6, 0.1))
def test_sigma_of_equal_noise(roll, pitch, sigma):
    """Roll loses accuracy with pitch, and with nothing else; pitch never."""
    found = sigma_roll_pitch(force(roll, pitch), sigma**2 * np.eye(3))
    np.testing.assert_allclose(found, [sigma / (G * np.cos(pitch)), sigma / G], rtol=1e-9)


@pytest.mark.parametrize(
    "noise", [(1, 1, 1), (1, 3, 1), (1, 10, 1), (1, 1, 10), (10, 1, 1), (0.1, 1, 0.3)]
)
def test_away_from_the_pole_two_sigmas_hold(noise):
    """Attitudes spread evenly about the pole, unequal noise of x, y, z; formulas of its own.

    At each measured distance at which the sigmas are said to hold, 93 to 97 % of the errors are
    below two of them, where 95.4 % are expected.
    """
    n, rng = 200_000, np.random.default_rng(4)
    sd_x, sd_y, sd_z = noise
    g, farthest = 2000.0, 30.0 * max(sd_y, sd_z)
    distance, azimuth = farthest * np.sqrt(rng.random(n)), rng.uniform(-np.pi, np.pi, n)
    true = (np.sqrt(g**2 - distance**2), distance * np.cos(azimuth), distance * np.sin(azimuth))
    x, y, z = (f + sd * rng.standard_normal(n) for f, sd in zip(true, noise, strict=True))
    found, wanted = (roll_and_pitch(np.stack(f, -1)) for f in ((x, y, z), true))
    out = np.hypot(y, z)
    along, across = np.hypot(y * sd_y, z * sd_z) / out, np.hypot(z * sd_y, y * sd_z) / out
    sigma = across / out, np.hypot(out * sd_x, x * along) / (x**2 + out**2)
    near = near_pole(found, np.stack(sigma, -1))
    assert 0.01 < near.mean() < 0.3
    inner = ~near & (out < 25.0 * max(sd_y, sd_z))  # at the rim all errors point outwards
    edges = np.quantile(out[inner], np.linspace(0, 1, 21))
    for angle, truth, sd in zip(found.T, wanted.T, sigma, strict=True):
        error = np.abs((angle - truth + np.pi) % (2 * np.pi) - np.pi)
        inside = error < 2 * sd
        for low, high in pairwise(edges):
            share = inside[inner & (out >= low) & (out <= high)].mean()
            assert 0.93 < share < 0.97, (low, share)


def test_the_pole_itself_is_too_close_whatever_the_sigmas_are():
    unknown = np.full(2, np.nan)
    assert near_pole([0.3, np.pi / 2], unknown)
    assert not near_pole([0.3, 1.5], unknown)
    assert not near_pole([0.3, 1.5], np.zeros(2))
    assert not near_pole([3.0, 0.0], np.full(2, 0.01))


def test_angles_wrap_to_half_a_turn_either_way():
    angles = np.array([[0.0, 0.5], [np.pi - 1e-9, -np.pi], [3.5 * np.pi, -4.2]])
    found = wrap_angle(angles)
    np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * angles), atol=1e-14)
    assert np.all((found >= -np.pi) & (found < np.pi))
    assert wrap_angle(np.pi) == -np.pi

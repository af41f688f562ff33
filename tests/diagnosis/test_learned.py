"""Learned functions: beside plain Gaussian processes, exported, and in campaigns that hide one."""

import numpy as np
import pytest
from diagnosis_helpers import some_holds
from usual import ROBOT, G

from accelstudy.adjustment import Observations, calibrate
from accelstudy.drawing.style import group_of, symbol
from accelstudy.effects import effect_names, get_effect
from accelstudy.leveling.angles import specific_force
from accelstudy.sensors.models import get_model

LOW, HIGH = 10.0, 40.0
GRID = np.linspace(-1, 1, 101)
SPEC = f"learned(coordinate=temperature, target=bias, low={LOW:g}, high={HIGH:g}"


def kernel(one, other, length):
    """Squared exponential of a coordinate from −1 to 1."""
    return np.exp(-((one[:, None] - other) ** 2) / (2 * length**2))


def observed(s, h, sigma, rng):
    """Readings of sensors that know their attitude, of biases h (R, n, 3) at s (n,)."""
    angles = np.column_stack([rng.uniform(-3, 3, len(s)), rng.uniform(-1.2, 1.2, len(s))])
    force = np.column_stack(specific_force(*angles.T, G))
    noise = sigma * rng.standard_normal(h.shape)
    hold = some_holds(len(s), temperature=(LOW + HIGH) / 2 + (HIGH - LOW) / 2 * s)
    return Observations(
        force + h + noise, sigma, np.broadcast_to(angles, (len(h), *angles.shape)), hold=hold
    )


def learned_of(result, k, effect, grid):
    """Function that a replicate has learned, and its sigma; its parameters follow the biases."""
    own = slice(3, 3 + len(effect.parameters))
    return effect.function(grid, result.parameters[k, own], result.cofactors[k, own, own])


@pytest.mark.parametrize("length", [0.25, 0.6, 1.5])
def test_a_learned_function_is_a_gaussian_process(length):
    """Ordinary kriging by linear algebra, with the kernel itself."""
    rng = np.random.default_rng(1)
    s, sigma, amplitude = np.sort(rng.uniform(-1, 1, 40)), 1e-3, 4e-3
    h = amplitude * np.sin(4 * s[:, None] + [0.0, 1.0, 2.0])
    data = observed(s, h[None], sigma, rng)
    effect = get_effect(f"{SPEC}, length={length}, amplitude={amplitude})")
    result = calibrate(get_model(f"bias+{effect.spec}"), ROBOT, data)
    got, sd = learned_of(result, 0, effect, (LOW + HIGH) / 2 + (HIGH - LOW) / 2 * GRID)

    seen = data.forces[0] - np.column_stack(specific_force(*data.angles[0].T, G))
    # A bias of which nothing is known.
    whole = np.concatenate([s, GRID])
    prior = amplitude**2 * kernel(whole, whole, length) + 1.0
    n = len(s)
    gain = prior[n:, :n] @ np.linalg.inv(prior[:n, :n] + sigma**2 * np.eye(n))
    centred = np.eye(len(GRID)) - 1 / len(GRID)
    covariance = centred @ (prior[n:, n:] - gain @ prior[:n, n:]) @ centred.T
    np.testing.assert_allclose(got, centred @ gain @ seen, atol=0.03 * amplitude)
    np.testing.assert_allclose(
        sd, np.sqrt(np.diag(covariance))[:, None] * np.ones(3), atol=0.02 * amplitude
    )


def test_a_spec_holds_all_and_is_not_listed():
    for spec, count in {
        "learned(coordinate=yaw, target=reading, length=1.5, amplitude=0.001)": 2 * 2 * 2,
        "learned(coordinate=time wave, target=bias, period=300, amplitude=0.01)": 2 * 3,
        f"{SPEC}, length=0.25, amplitude=0.01)": 12 * 3,
    }.items():
        effect = get_effect(spec)
        assert effect.spec == spec
        assert len(effect.parameters) == len(effect.deviations) == count
        assert get_model(f"bias-scale+{spec}").effects[-1].spec == spec
    names = get_model(f"bias+{effect.spec}").parameter_names
    assert [symbol(name) for name in names[3:5]] == ["$h_{x,1}$", "$h_{x,2}$"]
    assert {group_of(name) for name in names} == {"bias", "learned"}
    assert "learned" not in effect_names()


def test_a_learned_rotation_of_the_mounting_turns_the_force():
    """By Rodrigues' formula, of small angles."""
    effect = get_effect(f"{SPEC.replace('bias', 'mounting')}, length=1.5, amplitude=0.001)")
    h = effect.function(np.array([28.0]), w := np.linspace(-1e-4, 2e-4, len(effect.parameters)),
                        np.zeros((len(w), len(w))))[0][0]  # fmt: skip
    force, angle, axis = np.array([1.0, -4.0, 8.8]), np.linalg.norm(h), h / np.linalg.norm(h)
    turned = (
        np.cos(angle) * force
        + np.sin(angle) * np.cross(axis, force)
        + (1 - np.cos(angle)) * (axis @ force) * axis
    )
    added = effect.output(tuple(force), tuple(w), G, some_holds(1, temperature=28.0), np)
    np.testing.assert_allclose(
        np.ravel(added), turned - force, atol=angle**2 * np.linalg.norm(force)
    )

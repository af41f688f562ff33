"""Variance components of accelerometer and robot: recovered, and with honest sigmas."""

import math
from dataclasses import replace

import numpy as np
import pytest
from quality_helpers import GRAVITY, NINE, ROBOT, STANDARD_ERRORS, draw, one

from accelstudy.adjustment.quality import redundancy_numbers, solve, variance_components
from accelstudy.basics.units import MGON
from accelstudy.simulation.sessions import Noise

# At 3.2 mgon the robot is so much better than the sensor that no session can tell how good it is.
COARSE = Noise(sigma_angle=20 * MGON)


@pytest.mark.parametrize("factors", [(1, 1), (1, 4), (2.25, 0.8)])
def test_variance_components_are_recovered(factors):
    """Their mean over sessions is right, and so is the standard deviation given for them."""
    force, angle = np.sqrt(factors)
    truth = Noise(COARSE.sigma_force * force, COARSE.sigma_angle * angle)
    replicates = 100
    drawn = draw(21, "fibonacci-36", noise=truth, replicates=replicates)
    assumed = replace(drawn, sigma_force=COARSE.sigma_force, sigma_angle=COARSE.sigma_angle)
    found = [variance_components(NINE, ROBOT, one(assumed, i)) for i in range(replicates)]
    assert all(f.converged for f in found)
    values = np.array([f.factors for f in found])
    assert values.min() > 0
    spread = values.std(axis=0)
    limit = STANDARD_ERRORS * spread / math.sqrt(replicates)
    assert np.all(np.abs(values.mean(axis=0) - factors) < limit)
    claimed = np.sqrt(np.mean([f.sigma**2 for f in found], axis=0))
    np.testing.assert_allclose(spread, claimed, rtol=0.35)


def test_variance_components_are_the_fixed_point():
    """With both variances scaled, vᵀ Q⁻¹ v of each group is its redundancy (Förstner 1979)."""
    observed = draw(22, "fibonacci-36", noise=replace(COARSE, sigma_gravity=1e-5))
    found = variance_components(NINE, ROBOT, observed)
    force, angle = np.sqrt(found.factors)
    scaled = replace(
        observed,
        sigma_force=force * observed.sigma_force,
        sigma_angle=angle * observed.sigma_angle,
    )
    solution = solve(NINE, ROBOT, scaled)
    shares = redundancy_numbers(solution).observations
    squares = solution.residuals**2 / solution.variances
    for part, expected in zip((slice(0, 3), slice(3, 5)), found.redundancy, strict=True):
        assert shares[:, part].sum() == pytest.approx(expected, rel=1e-4)
        assert squares[:, part].sum() == pytest.approx(expected, rel=1e-3)
    again = variance_components(NINE, ROBOT, scaled)
    np.testing.assert_allclose(again.factors, 1, atol=1e-3)


def test_a_component_that_is_not_there_goes_to_zero_and_not_below():
    """A perfect robot, believed to have 20 mgon."""
    drawn = draw(23, noise=Noise(sigma_angle=0.0), replicates=30)
    assumed = replace(drawn, sigma_angle=COARSE.sigma_angle)
    found = [variance_components(NINE, ROBOT, one(assumed, i)) for i in range(30)]
    assert all(f.converged for f in found)
    robot = np.array([f.factors[1] for f in found])
    assert robot.min() >= 0
    assert 0.2 < np.mean(robot < 1e-3) < 0.8
    assert all(0.3 < f.factors[0] < 2 for f in found)


def test_there_are_no_components_without_two_groups():
    assert variance_components(NINE, GRAVITY, draw(1)) is None
    assert variance_components(NINE, ROBOT, draw(1, noise=Noise(sigma_angle=0.0))) is None

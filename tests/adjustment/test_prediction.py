"""What a calibration says of the data: held-out errors and variance components."""

from dataclasses import replace

import numpy as np
from quality_helpers import SIGMA, draw, ideal_session
from usual import BOTH, GRAVITY, NINE, ROBOT

from accelstudy.adjustment import calibrate
from accelstudy.adjustment.components import variance_components
from accelstudy.adjustment.quality import held_out, position_tests, reliability, solve
from accelstudy.basics.units import MGON
from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import roll_pitch, specific_force
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise, session


def thermal_session(seed=2):
    model = get_model(f"{NINE.name}+thermal_bias")
    hold = HoldConditions(temperature=15 * np.sin(np.arange(24.0)))
    ideal = ideal_session("mclaren-24", model, hold)
    observed = ideal.draw(Noise(sigma_gravity=1e-5), 1, np.random.default_rng(seed))
    # A standard deviation of its own for each position and axis.
    sigma = SIGMA * np.linspace(0.5, 1.5, 72).reshape(24, 3)
    return model, replace(observed, sigma_force=sigma)


@BOTH
def test_leaving_out_is_a_calibration_without_the_position(approach):
    """To first order; with columns, standard deviations that differ, and observed gravity."""
    model, observed = thermal_session()
    found = held_out(solve(model, approach, observed))
    assert found.n_predicted == 24
    for position in (0, 10, 23):
        rest = observed.take(np.delete(np.arange(24), position))
        x = calibrate(model, approach, rest).parameters[0]
        alone = observed.take(np.array([position]))
        f_b = model.correct(alone.forces[0], x[:-1], x[-1], alone.hold)
        psi = np.linalg.norm(f_b) - x[-1]
        if approach is ROBOT:
            told = np.array(specific_force(*alone.angles[0].T, x[-1])).T
            psi = alone.forces[0] - model.sense(told, x[:-1], x[-1], alone.hold)
        np.testing.assert_allclose(
            found.misclosures[position], np.ravel(psi), rtol=0, atol=2e-3 * SIGMA
        )
        if approach is ROBOT:
            expected = np.ravel(roll_pitch(tuple(f_b.T))) - alone.angles[0, 0]
            expected[0] = (expected[0] + np.pi) % (2 * np.pi) - np.pi
            np.testing.assert_allclose(found.angles[position], expected, atol=1e-6)


def test_held_out_attitudes_at_the_poles():
    """Two of the faces have the x axis vertical, where roll has no meaning."""
    observed = draw(1, "faces-edges-18")
    found = held_out(solve(NINE, ROBOT, observed))
    vertical = np.abs(get_scheme("faces-edges-18").directions[:, 0]) > 0.999
    assert np.count_nonzero(vertical) == 2
    np.testing.assert_array_equal(np.isnan(found.angles[:, 0]), vertical)
    assert not np.isnan(found.angles[:, 1]).any()
    assert not np.isnan(found.misclosures).any()
    assert np.all(found.rms_angles < 30 * MGON)
    assert held_out(solve(NINE, GRAVITY, observed)).rms_angles is None


def test_a_position_that_the_others_need_is_not_predicted():
    """Without the only position that has z up or down, nothing tells the scale of z."""
    model = get_model("bias-scale")
    level = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = np.stack([np.cos(level), np.sin(level), 0 * level], axis=-1)
    directions = np.concatenate([ring, [[0, 0, 1.0]]])
    observed = session(model, np.zeros(6), directions).observations(Noise())
    found = held_out(solve(model, ROBOT, observed))
    assert found.n_predicted == 12
    assert np.isnan(found.misclosures[-1]).all()
    assert found.rms < 1e-6
    tests = position_tests(solve(model, ROBOT, observed))
    assert tests.dof[-1] == 2
    assert np.isinf(reliability(solve(model, ROBOT, observed)).mdb[-1]).all()


# At 3.2 mgon the robot is so much better than the sensor that no session can tell how good it is.
COARSE = Noise(sigma_angle=20 * MGON)


def test_a_component_that_is_not_there_goes_to_zero_and_not_below():
    """A perfect robot, believed to have 20 mgon."""
    drawn = draw(23, noise=Noise(sigma_angle=0.0), replicates=30)
    assumed = replace(drawn, sigma_angle=COARSE.sigma_angle)
    each = [assumed.sessions(slice(i, i + 1)) for i in range(30)]
    found = [variance_components(NINE, ROBOT, one) for one in each]
    assert all(f.converged for f in found)
    robot = np.array([f.factors[1] for f in found])
    assert robot.min() >= 0
    assert 0.2 < np.mean(robot < 1e-3) < 0.8
    assert all(0.3 < f.factors[0] < 2 for f in found)


def test_there_are_no_components_without_two_groups():
    assert variance_components(NINE, GRAVITY, draw(1)) is None
    assert variance_components(NINE, ROBOT, draw(1, noise=Noise(sigma_angle=0.0))) is None


def test_numbers_that_are_no_session_have_no_components():
    """Readings in whole units of gravity, whose factors would grow beyond all bounds."""
    observed = session(NINE, np.zeros(9), get_scheme("random-13-7").directions, 9.80665)
    observed = observed.observations(Noise())
    coarse = replace(observed, forces=np.round(observed.forces / 9.80665) * 9.80665)
    assert variance_components(NINE, ROBOT, coarse) is None

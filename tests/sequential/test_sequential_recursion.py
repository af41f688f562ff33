"""The recursive adjustment: at each position the same as the adjustment of all positions so far."""

import numpy as np
import pytest

from accelstudy.adjustment import calibrate, gauss_helmert
from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.adjustment.gauss_helmert import adjust
from accelstudy.adjustment.quality import position_tests, solve
from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.effects import HoldConditions
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.sequential.information import Prior
from accelstudy.sequential.recursion import Recursion
from accelstudy.simulation.sessions import Noise, session

NINE = "bias-scale-nonorthogonality"
VALUES = {"b_x": 0.05, "b_y": -0.02, "s_x": 2e-4, "s_z": 1e-3, "alpha_yz": 1e-3, "alpha_zx": -2e-3,
          "k2_x": 1e-4, "k3_y": 1e-4, "w_x": 0.01}  # fmt: skip
CASES = {
    "gravity": (NINE, "gravity", {}),
    "robot": (NINE, "robot", {}),
    "gravity-observed": (NINE, "gravity", {"sigma_gravity": 1e-5}),
    "robot-observed": ("bias-scale", "robot", {"sigma_gravity": 1e-5}),
    "quadratic": (f"{NINE}-quadratic", "gravity", {}),
    "twelve": (f"{NINE}-crossaxis", "robot", {}),
    "warm-up": (f"{NINE}+warm_up(tau=300)", "robot", {}),
    "settling": ("bias-scale+settling", "robot", {}),
}
N, SESSIONS = 24, 6


@pytest.fixture(autouse=True)
def converged_to_the_end(monkeypatch):
    """The adjustment of all positions ends a step early for a comparison to 1e-9."""
    monkeypatch.setattr(gauss_helmert, "STEP_TOLERANCE", 1e-11)


def observed(model, noise=None, n=N, sessions=SESSIONS):
    order = np.random.default_rng(1).permutation(n)
    hold = HoldConditions(time=60.0 * np.arange(n), yaw=np.zeros(n))
    ideal = session(
        model, model.vector(VALUES), get_scheme(f"fibonacci-{n}").directions[order], hold=hold
    )
    return ideal.draw(noise or Noise(), sessions, np.random.default_rng(2))


def assert_same(recursion, batch, tolerance=1e-9):
    """Equal in standard deviations: parameters, covariances, Ω, residuals."""
    assert recursion.redundancy == batch.redundancy
    np.testing.assert_array_equal(recursion.solved, batch.converged)
    ok = batch.converged
    sigma = batch.sigma_priori[ok]
    shift = (recursion.parameters - batch.parameters)[ok] / sigma
    spread = (recursion.cofactors - batch.cofactors)[ok] / (sigma[:, :, None] * sigma[:, None])
    omega = (recursion.omega - batch.omega)[ok]
    for difference in (shift, spread, omega):
        np.testing.assert_allclose(difference, 0, atol=tolerance)
    np.testing.assert_allclose(
        recursion.residuals[ok][..., :3] / 0.002, batch.residuals[ok][..., :3] / 0.002, atol=1e-8
    )


@pytest.mark.parametrize("case", CASES)
def test_each_position_gives_the_solution_of_all_positions_so_far(case):
    name, approach, noise = CASES[case]
    model, approach = get_model(name), get_approach(approach)
    sessions = observed(model, Noise(**noise))
    recursion = Recursion(model, approach, sessions.take(np.arange(0)))
    compared = 0
    for n in range(1, N + 1):
        so_far = sessions.take(np.arange(n))
        recursion.add(so_far)
        if recursion.redundancy < 0:
            assert not recursion.solved.any()
            assert np.isnan(recursion.parameters).all()
            continue
        batch = calibrate(model, approach, so_far)
        assert_same(recursion, batch)
        compared += batch.converged.all()
    assert compared > N / 3


def test_many_positions_at_once_are_those_one_by_one():
    model, approach = get_model(NINE), get_approach("gravity")
    sessions = observed(model)
    one_by_one = Recursion(model, approach, sessions.take(np.arange(3)))
    for n in range(4, N + 1):
        one_by_one.add(sessions.take(np.arange(n)))
    at_once = Recursion(model, approach, sessions)
    np.testing.assert_array_equal(at_once.parameters, one_by_one.parameters)
    assert at_once.n_positions == N


def test_a_session_does_not_depend_on_those_beside_it():
    model, approach = get_model(NINE), get_approach("robot")
    sessions = observed(model)
    together = Recursion(model, approach, sessions)
    for i in (0, SESSIONS - 1):
        alone = Recursion(model, approach, sessions.sessions(slice(i, i + 1)))
        np.testing.assert_array_equal(alone.parameters[0], together.parameters[i])
        np.testing.assert_array_equal(alone.omega[0], together.omega[i])


# --- what is known beforehand --------------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 1, 5, 12])
def test_a_factory_calibration_is_observations_of_the_parameters(n):
    model, approach = get_model(NINE), get_approach("gravity")
    so_far = observed(model).take(np.arange(n))
    mean = model.vector({"b_x": 0.04, "s_x": 1e-4})
    sigma = np.repeat([0.02, 1e-3, 2e-3], 3)
    recursion = Recursion(model, approach, so_far, Prior(mean, np.diag(1 / sigma)))
    assert recursion.redundancy == n
    if n == 0:  # and nothing else is known
        np.testing.assert_allclose(recursion.parameters, np.tile(mean, (SESSIONS, 1)), atol=1e-14)
        np.testing.assert_allclose(recursion.cofactors[0], np.diag(sigma**2), rtol=1e-12)
        return
    problem = CalibrationProblem.of(model, approach, so_far)
    batch = adjust(
        problem.conditions, problem.observations, problem.cofactors, mean,
        parameter_observations=mean, parameter_weights=sigma**-2,
        latent=np.moveaxis(problem.observations, -1, 0),
    )  # fmt: skip
    assert batch.converged.all()
    assert_same(recursion, batch)


def test_a_covariance_matrix_says_more_than_its_sigmas():
    model, approach = get_model("bias-scale"), get_approach("robot")
    sessions = observed(model)
    first = Recursion(model, approach, sessions.take(np.arange(12)))
    earlier = Prior.of_covariance(first.parameters[0], first.cofactors[0])
    alone = sessions.sessions(slice(0, 1))
    later = Recursion(model, approach, alone.take(np.arange(12, N)), earlier)
    whole = Recursion(model, approach, alone)
    sigma = np.sqrt(np.diagonal(whole.cofactors[0]))
    # The same but for the place at which the first half is linearised.
    np.testing.assert_allclose(later.parameters[0] / sigma, whole.parameters[0] / sigma, atol=2e-3)


def test_a_prior_that_is_none():
    with pytest.raises(InputError, match="positive definite"):
        Prior.of_covariance(np.zeros(2), np.zeros((2, 2)))


# --- a coarser tolerance -------------------------------------------------------------------------


@pytest.mark.parametrize("approach", ["gravity", "robot"])
def test_a_coarser_tolerance_is_kept_and_saves_passes(approach):
    model, approach = get_model(NINE), get_approach(approach)
    sessions = observed(model, sessions=40)
    recursion = Recursion(model, approach, sessions.take(np.arange(0)), tolerance=1e-2)
    passes = []
    for n in range(1, N + 1):
        recursion.add(sessions.take(np.arange(n)))
        if n > 12:
            passes.append(recursion.passes)
            batch = calibrate(model, approach, sessions.take(np.arange(n)))
            off = np.abs(recursion.parameters - batch.parameters) / batch.sigma_priori
            assert off.max() < 5e-2
    assert np.mean(passes) < 0.2


# --- the test of a new position ------------------------------------------------------------------


@pytest.mark.parametrize("approach", ["gravity", "robot"])
def test_the_test_of_a_new_position_is_that_of_the_last_of_all(approach):
    model, approach = get_model(NINE), get_approach(approach)
    alone = observed(model, sessions=1)
    before = Recursion(model, approach, alone.take(np.arange(N - 1)))
    prediction = before.predict(alone)
    tests = position_tests(solve(model, approach, alone))
    assert prediction.statistic[0] == pytest.approx(tests.statistic[-1], rel=2e-3)
    assert prediction.p_value()[0] == pytest.approx(tests.p_known[-1], rel=5e-3)
    unknown = prediction.p_value(before.omega, before.redundancy)
    assert unknown[0] == pytest.approx(tests.p_unknown[-1], rel=5e-3)
    assert before.n_positions == N - 1  # it was not used


def test_p_values_of_good_positions_are_uniform_and_a_bump_is_seen():
    model, approach = get_model(NINE), get_approach("gravity")
    sessions = observed(model, n=14, sessions=2000)
    before = Recursion(model, approach, sessions.take(np.arange(13)), tolerance=1e-3)
    prediction = before.predict(sessions)
    for p in (prediction.p_value(), prediction.p_value(before.omega, before.redundancy)):
        for level in (0.05, 0.5):
            error = np.sqrt(level * (1 - level) / 2000)
            assert np.mean(p < level) == pytest.approx(level, abs=4 * error)
    sessions.forces[:, -1] *= 1.003
    assert np.mean(before.predict(sessions).p_value() < 1e-3) > 0.8
    assert np.isnan(prediction.p_value(before.omega, 0)).all()


def test_without_a_solution_nothing_is_claimed():
    """Readings of nothing but noise: no calibration, flagged, and the next position goes on."""
    model, approach = get_model(NINE), get_approach("gravity")
    sessions = observed(model, sessions=2)
    sessions.forces[1, :12] = 3 * np.random.default_rng(5).standard_normal((12, 3))
    with np.errstate(all="ignore"):
        recursion = Recursion(model, approach, sessions.take(np.arange(12)))
        batch = calibrate(model, approach, sessions.take(np.arange(12)))
    assert recursion.solved.tolist() == batch.converged.tolist() == [True, False]
    assert np.isnan(recursion.parameters[1]).all()
    assert np.isnan(recursion.omega[1])
    assert np.isnan(recursion.residuals[1]).all()

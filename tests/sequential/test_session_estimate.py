"""What sessions tell so far: the adjustment of their positions, and what was known before."""

import numpy as np
import pytest

from accelstudy.adjustment import calibrate, gauss_helmert
from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.sequential.estimate import Prior, estimate, has_full_rank
from accelstudy.simulation.sessions import Noise, session

NINE = "bias-scale-nonorthogonality"
VALUES = {"b_x": 0.05, "b_y": -0.02, "s_x": 2e-4, "s_z": 1e-3, "alpha_yz": 1e-3, "alpha_zx": -2e-3}
CASES = {
    "gravity": (NINE, "gravity", {}),
    "robot": (NINE, "robot", {}),
    "gravity-observed": (NINE, "gravity", {"sigma_gravity": 1e-5}),
    "robot-observed": ("bias-scale", "robot", {"sigma_gravity": 1e-5}),
    "twelve": (f"{NINE}-crossaxis", "robot", {}),
}
N, SESSIONS = 24, 6


@pytest.fixture(autouse=True)
def converged_to_the_end(monkeypatch):
    """The adjustment ends a step early for a comparison to 1e-9."""
    monkeypatch.setattr(gauss_helmert, "STEP_TOLERANCE", 1e-11)


def observed(model, noise=None, n=N, sessions=SESSIONS):
    order = np.random.default_rng(1).permutation(n)
    ideal = session(model, model.vector(VALUES), get_scheme(f"fibonacci-{n}").directions[order])
    return ideal.draw(noise or Noise(), sessions, np.random.default_rng(2))


@pytest.mark.parametrize("case", CASES)
def test_each_position_gives_the_calibration_of_all_positions_so_far(case):
    name, approach, noise = CASES[case]
    model, approach = get_model(name), get_approach(approach)
    sessions = observed(model, Noise(**noise))
    compared = 0
    for n in range(N + 1):
        part = sessions.take(np.arange(n))
        so_far = estimate(model, approach, part)
        assert so_far.n_positions == n
        if so_far.redundancy < 0:
            assert not so_far.solved.any()
            assert np.isnan(so_far.parameters).all()
            continue
        whole = calibrate(model, approach, part)
        assert so_far.redundancy == whole.redundancy
        ok = so_far.solved & whole.converged
        sigma = whole.sigma_priori[ok]
        shift = (so_far.parameters - whole.parameters)[ok] / sigma
        scale = sigma[:, :, None] * sigma[:, None]
        spread = (so_far.cofactors - whole.cofactors)[ok] / scale
        for difference in (shift, spread, (so_far.omega - whole.omega)[ok]):
            np.testing.assert_allclose(difference, 0, atol=1e-8)
        compared += ok.all()
    assert compared > N / 3


def test_a_session_does_not_depend_on_those_beside_it():
    model, approach = get_model(NINE), get_approach("robot")
    sessions = observed(model)
    together = estimate(model, approach, sessions)
    for i in (0, SESSIONS - 1):
        alone = estimate(model, approach, sessions.sessions(slice(i, i + 1)))
        np.testing.assert_allclose(alone.parameters[0], together.parameters[i], rtol=1e-9)
        np.testing.assert_allclose(alone.omega[0], together.omega[i], rtol=1e-9)
        part = together.sessions(np.array([i]))
        np.testing.assert_array_equal(part.parameters[0], together.parameters[i])


def test_information_of_two_sessions_adds():
    """The rank of each is too small, that of both is not: faces of a cube, then its edges."""
    model, approach = get_model(NINE), get_approach("gravity")
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    edges = np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1]]) / np.sqrt(2)
    parts = [
        estimate(model, approach, session(model, np.zeros(9), each).draw(
            Noise(1e-9), 1, np.random.default_rng(1)))
        for each in (faces, edges, np.concatenate([faces, edges]))
    ]  # fmt: skip
    both = parts[0].information + parts[1].information
    assert [has_full_rank(each)[0] for each in (parts[0].information, both)] == [False, True]
    np.testing.assert_allclose(both[0], parts[2].information[0], rtol=1e-5, atol=1e-6 * both.max())


# --- what is known beforehand --------------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 1, 5, 12])
def test_a_factory_calibration_is_observations_of_the_parameters(n):
    model, approach = get_model(NINE), get_approach("gravity")
    so_far = observed(model).take(np.arange(n))
    mean = model.vector({"b_x": 0.04, "s_x": 1e-4})
    sigma = np.repeat([0.02, 1e-3, 2e-3], 3)
    known = {n: (m, s) for n, m, s in zip(model.parameter_names, mean, sigma, strict=True)}
    found = estimate(model, approach, so_far, Prior.of_known(known, model))
    assert found.redundancy == n
    assert found.solved.all()
    if n == 0:  # and nothing else is known
        np.testing.assert_allclose(found.parameters, np.tile(mean, (SESSIONS, 1)), atol=1e-14)
        np.testing.assert_allclose(found.cofactors[0], np.diag(sigma**2), rtol=1e-12)
        return
    # By least squares of linearised lengths, iterated: |c(f)| = g, and the parameters as observed.
    for i in range(SESSIONS):
        x, forces = mean.copy(), so_far.forces[i]
        for _ in range(5):
            f = model.correct(forces, x)
            out = np.linalg.norm(f, axis=1)
            unit = (f / out[:, None])[:, None]
            by_x = (unit @ model.correction_jacobian(forces, x))[:, 0]
            slope = np.linalg.norm((unit @ model.output_jacobian(forces, x))[:, 0], axis=1)
            rows = np.concatenate([by_x / (0.002 * slope)[:, None], np.diag(1 / sigma)])
            left = np.concatenate([(9.80665 - out) / (0.002 * slope), (mean - x) / sigma])
            x = x + np.linalg.lstsq(rows, left)[0]
        own = np.sqrt(np.diag(found.cofactors[i]))
        np.testing.assert_allclose((found.parameters[i] - x) / own, 0, atol=2e-2)
        np.testing.assert_allclose(own, np.sqrt(np.diag(np.linalg.inv(rows.T @ rows))), rtol=1e-3)


def test_a_covariance_matrix_says_more_than_its_sigmas():
    model, approach = get_model("bias-scale"), get_approach("robot")
    alone = observed(model).sessions(slice(0, 1))
    first = estimate(model, approach, alone.take(np.arange(12)))
    earlier = Prior.of_covariance(first.parameters[0], first.cofactors[0])
    later = estimate(model, approach, alone.take(np.arange(12, N)), earlier)
    whole = estimate(model, approach, alone)
    sigma = np.sqrt(np.diagonal(whole.cofactors[0]))
    # The same but for the place at which the first half is linearised.
    np.testing.assert_allclose(later.parameters[0] / sigma, whole.parameters[0] / sigma, atol=2e-3)
    assert later.redundancy == 12 * 3


def test_a_prior_that_is_none():
    with pytest.raises(InputError, match="positive definite"):
        Prior.of_covariance(np.zeros(2), np.zeros((2, 2)))


def test_without_a_solution_nothing_is_claimed():
    """Readings of nothing but noise: no calibration, flagged, and the next position goes on."""
    model, approach = get_model(NINE), get_approach("gravity")
    sessions = observed(model, sessions=2)
    sessions.forces[1, :12] = 3 * np.random.default_rng(5).standard_normal((12, 3))
    with np.errstate(all="ignore"):
        found = estimate(model, approach, sessions.take(np.arange(12)))
    assert found.solved.tolist() == [True, False]
    assert np.isnan(found.parameters[1]).all()
    assert np.isnan(found.omega[1])
    assert np.isfinite(found.information).all()

"""How good a calibration is: its linearised solution, tests, redundancy and reliability.

Claims of probability are held against a seeded Monte Carlo, with limits of 4.5 standard errors.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from quality_helpers import SIGMA, draw, ideal_session, solutions
from scipy.stats import chi2, f, kstest, ncf, ncx2
from usual import BOTH, GRAVITY, NINE, ROBOT, STANDARD_ERRORS

from accelstudy.adjustment import calibrate
from accelstudy.adjustment.quality import (
    global_test,
    holm,
    noncentrality,
    position_tests,
    reliability,
    solve,
    suspects,
)
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON, MGON, STANDARD_GRAVITY
from accelstudy.leveling.angles import roll_pitch
from accelstudy.leveling.error import cap_forces
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import MODELS, get_model
from accelstudy.simulation.sessions import Noise, session


@BOTH
@pytest.mark.parametrize("sigma_gravity", [0.0, 1e-5])
def test_a_solution_reproduces_the_adjustment(approach, sigma_gravity):
    observed = draw(1, noise=Noise(sigma_gravity=sigma_gravity))
    result, solution = calibrate(NINE, approach, observed), solve(NINE, approach, observed)
    e, a = solution.errors, solution.design
    assert e @ e == pytest.approx(result.omega[0], rel=1e-9)
    np.testing.assert_allclose(a.T @ e, 0, atol=1e-5 * np.linalg.norm(a, axis=0).max())
    normal = np.linalg.inv(result.cofactors[0])
    np.testing.assert_allclose(a.T @ a, normal, rtol=1e-6, atol=1e-9 * normal.max())
    np.testing.assert_allclose(solution.basis.T @ e, 0, atol=1e-6)
    # v = −Q Bᵀ L⁻ᵀ e
    white = np.linalg.solve(solution.whitening, solution.jac_observations)
    part = e[: white.shape[0] * white.shape[1]].reshape(white.shape[:2])
    v = -solution.variances * np.einsum("nco,nc->no", white, part)
    np.testing.assert_allclose(v, result.residuals[0], atol=1e-7 * SIGMA)


def test_a_calibration_without_a_solution_has_no_quality():
    with pytest.raises(InputError, match="one session, not of 3"):
        solve(NINE, GRAVITY, draw(1, replicates=3))
    model = get_model("bias-scale-nonorthogonality-crossaxis")
    with pytest.raises(InputError, match="no solution: its normal matrix is singular"):
        solve(model, GRAVITY, draw(0, model=model))
    observed = draw(0)
    broken = replace(observed, forces=np.where(observed.forces > 9, np.nan, observed.forces))
    with pytest.raises(InputError, match="no solution"):
        solve(NINE, ROBOT, broken)


def test_the_global_test_rejects_on_either_side():
    assert global_test(15.0, 15).accepted
    assert not global_test(40.0, 15).accepted
    assert not global_test(3.0, 15).accepted
    assert global_test(40.0, 15, alpha=1e-4).accepted
    assert global_test(60.0, 15, variance=4.0).accepted
    limits = chi2.ppf([0.025, 0.975], 15)
    assert [global_test(x, 15).p_value for x in limits] == pytest.approx([0.05, 0.05])
    assert global_test(0.0, 0) is None
    assert [global_test(1.0, r).powerless for r in (1, 2, 3)] == [True, True, False]


@hypothesis_settings(max_examples=40)
@given(
    scheme=st.sampled_from(["mclaren-24", "faces-edges-18", "fibonacci-24", "fibonacci-36"]),
    model=st.sampled_from([name for name in MODELS if not name.endswith("crossaxis")]),
    approach=st.sampled_from([GRAVITY, ROBOT]),
    sigma_gravity=st.sampled_from([0.0, 1e-5, 1e-3]),
    sigma_angle=st.sampled_from([0.0, 3.2 * MGON]),
    seed=st.integers(0, 1000),
)
def test_redundancy_numbers_sum_up_to_r(scheme, model, approach, sigma_gravity, sigma_angle, seed):
    model = get_model(model)
    noise = Noise(sigma_gravity=sigma_gravity, sigma_angle=sigma_angle)
    observed = draw(seed, scheme, model, noise)
    try:
        solution = solve(model, approach, observed)
    except InputError:  # too few positions for the model
        n_conditions = observed.forces.shape[1] * approach.n_conditions
        assert approach is GRAVITY
        assert n_conditions < 24
        return
    shares, positions = solution.shares, solution.redundancy_numbers
    gravity = 1 - np.sum(solution.basis[-1] ** 2) if sigma_gravity else 0.0
    assert positions.sum() + gravity == pytest.approx(solution.redundancy, abs=1e-8)
    np.testing.assert_allclose(shares.sum(axis=1), positions, atol=1e-10)
    assert shares.min() > -1e-10
    assert shares.max() < 1 + 1e-10


def test_holm():
    p = np.array([0.01, np.nan, 0.04, 0.03, 0.9])
    np.testing.assert_allclose(holm(p), [0.04, np.nan, 0.09, 0.09, 0.9])
    assert np.isnan(holm(np.full(3, np.nan))).all()


NULL = 500


@pytest.fixture(scope="module")
def null_tests():
    """Tests of 500 sessions without a gross error, at the poles too."""
    return {
        approach.name: [
            position_tests(s)
            for s in solutions(approach, draw(5, "faces-edges-18", replicates=NULL))
        ]
        for approach in (GRAVITY, ROBOT)
    }


@BOTH
@pytest.mark.parametrize("kind", ["p_known", "p_unknown"])
def test_p_values_are_uniform_and_the_family_wise_error_is_controlled(null_tests, approach, kind):
    """18 tests at 0.1 each would reject something in more than half of the sessions."""
    tests = null_tests[approach.name]
    p = np.array([getattr(t, kind) for t in tests])
    assert not np.isnan(p).any()
    for position in (0, 4, 11):
        assert kstest(p[:, position], "uniform").pvalue > 1e-4
    # The p-values of one session are correlated, those of different sessions are not.
    rejected = np.mean(p < 0.05, axis=1)
    limit = STANDARD_ERRORS * rejected.std() / math.sqrt(NULL)
    assert rejected.mean() == pytest.approx(0.05, abs=limit)
    alpha = 0.1
    error = np.mean([np.min(t.p_adjusted(kind == "p_known")) < alpha for t in tests])
    limit = STANDARD_ERRORS * math.sqrt(alpha * (1 - alpha) / NULL)
    assert alpha / 3 < error < alpha + limit
    assert np.mean(np.min(p, axis=1) < alpha) > 0.5


@BOTH
def test_studentised_and_tau_are_one_test(null_tests, approach):
    """τ²/r and F/(F + (r − q)/q)/q are the same share of Ω (Pope 1976)."""
    t, q = null_tests[approach.name][0], approach.n_conditions
    r = 18 * q - 9
    share = q * t.studentised / (q * t.studentised + r - q)
    np.testing.assert_allclose(q * t.tau**2 / r, share, rtol=1e-10)


def with_error(observed, position, error):
    """Add an error (3,) to the forces of a position."""
    forces = observed.forces.copy()
    forces[:, position] += error
    return replace(observed, forces=forces)


@BOTH
@pytest.mark.parametrize("position", [0, 7, 23])
@pytest.mark.parametrize("sigma_known", [True, False])
def test_an_outlier_of_ten_sigma_is_found(approach, position, sigma_known):
    observed = draw(9)
    radial = observed.forces[0, position] / STANDARD_GRAVITY
    wrong = with_error(observed, position, 10 * SIGMA * radial)
    (found,) = suspects(NINE, approach, wrong, sigma_known=sigma_known)
    assert found.position == position
    assert found.p_value < 0.05
    tests = position_tests(solve(NINE, approach, wrong))
    assert tests.worst(sigma_known) == position
    assert suspects(NINE, approach, observed, alpha=1e-3, sigma_known=sigma_known) == ()


def test_noncentrality():
    assert noncentrality(1) == pytest.approx(17.075, abs=1e-3)
    for dof in (1, 3):
        critical = chi2.isf(0.001, dof)
        assert ncx2.sf(critical, dof, noncentrality(dof)) == pytest.approx(0.8, abs=1e-9)
    assert noncentrality(3) > noncentrality(1)
    for dof, noise_dof in ((1, 1), (3, 7), (25, 1)):
        critical, size = f.isf(0.001, dof, noise_dof), noncentrality(dof, noise_dof=noise_dof)
        assert ncf.sf(critical, dof, noise_dof, size) == pytest.approx(0.8, abs=2e-3)


def test_the_detectable_error_of_a_uniform_scheme():
    """σ √(λ0 / r_i) with r_i = 15/24 in each position."""
    directions = get_scheme("mclaren-24").directions
    ideal = session(NINE, np.zeros(9), directions).observations(Noise())
    found = reliability(solve(NINE, GRAVITY, ideal))
    expected = SIGMA * math.sqrt(noncentrality(1) * 24 / 15)
    np.testing.assert_allclose(found.mdb, expected, rtol=1e-9)
    assert expected == pytest.approx(10.45e-3, abs=0.01e-3)


@BOTH
def test_the_power_at_the_detectable_error_is_0_8(approach):
    """With σ0 unknown it is that of the noncentral F, the less the smaller the redundancy."""
    replicates, position = 500, 5
    observed = draw(11, replicates=replicates)
    solution = next(solutions(approach, observed))
    found = reliability(solution)
    if approach is GRAVITY:
        error = found.mdb[position, 0] * observed.forces[0, position] / STANDARD_GRAVITY
    else:  # along the largest axis of the ellipsoid
        u, s, _ = np.linalg.svd(solution.whitening[position] @ solution.root[0][position])
        error = found.mdb[position, -1] * u[:, 0]
        assert s[0] * math.sqrt(noncentrality(3)) == pytest.approx(found.mdb[position, -1])
    wrong = with_error(observed, position, error)
    tests = [position_tests(s) for s in solutions(approach, wrong)]
    p = np.array([(t.p_known[position], t.p_unknown[position]) for t in tests])
    dof = (approach.n_conditions, solution.redundancy - approach.n_conditions)
    unknown = ncf.sf(f.isf(0.001, *dof), *dof, noncentrality(dof[0]))
    assert unknown < 0.77
    limit = STANDARD_ERRORS * math.sqrt(0.16 / replicates)
    assert np.mean(p < 0.001, axis=0) == pytest.approx([0.8, unknown], abs=limit)


def test_the_external_reliability_is_what_such_an_error_does():
    ideal = ideal_session().observations(Noise())
    solution = solve(NINE, GRAVITY, ideal)
    found, position = reliability(solution), 6
    error = found.mdb[position, 0] * ideal.forces[0, position] / STANDARD_GRAVITY
    moved = calibrate(NINE, GRAVITY, with_error(ideal, position, error)).parameters[0]
    f_b = cap_forces(50 * GON, 64)
    output = NINE.sense(f_b, solution.parameters)
    angles = [np.stack(roll_pitch(tuple(f.T))) for f in (NINE.correct(output, moved), f_b)]
    rms = np.sqrt(np.mean((angles[0] - angles[1]) ** 2, axis=1))
    np.testing.assert_allclose(rms, found.leveling[position], rtol=0.01)

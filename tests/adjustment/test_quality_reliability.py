"""Reliability: the power at the detectable error, and what such an error does."""

import math

import numpy as np
import pytest
from quality_helpers import (
    BOTH,
    GRAVITY,
    NINE,
    ROBOT,
    SIGMA,
    STANDARD_ERRORS,
    draw,
    ideal_session,
    solutions,
    with_error,
)
from scipy.stats import chi2, f, ncf, ncx2

from accelstudy.adjustment import calibrate
from accelstudy.adjustment.quality import (
    held_out,
    noncentrality,
    position_tests,
    reliability,
    solve,
    suspects,
)
from accelstudy.basics.units import GON, STANDARD_GRAVITY
from accelstudy.leveling.angles import roll_pitch
from accelstudy.leveling.error import cap_forces
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise, session


def test_noncentrality():
    assert noncentrality(1) == pytest.approx(17.075, abs=1e-3)
    for dof in (1, 3):
        critical = chi2.isf(0.001, dof)
        assert ncx2.sf(critical, dof, noncentrality(dof)) == pytest.approx(0.8, abs=1e-9)
    assert noncentrality(3) > noncentrality(1)


def test_the_detectable_error_of_a_uniform_scheme():
    """σ √(λ0 / r_i) with r_i = 15/24 in each position."""
    directions = get_scheme("mclaren-24").directions
    ideal = session(NINE, np.zeros(9), directions).observations(Noise())
    found = reliability(solve(NINE, GRAVITY, ideal))
    expected = SIGMA * math.sqrt(noncentrality(1) * 24 / 15)
    np.testing.assert_allclose(found.mdb, expected, rtol=1e-9)
    assert expected == pytest.approx(10.45e-3, abs=0.01e-3)


@BOTH
@pytest.mark.parametrize("sigma_known", [True, False])
def test_the_power_at_the_detectable_error_is_0_8(approach, sigma_known):
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
        assert s[0] * math.sqrt(found.noncentrality) == pytest.approx(found.mdb[position, -1])
    wrong = with_error(observed, position, error)
    tests = [position_tests(s) for s in solutions(approach, wrong)]
    p = np.array([(t.p_known if sigma_known else t.p_unknown)[position] for t in tests])
    power, limit = np.mean(p < 0.001), STANDARD_ERRORS * math.sqrt(0.16 / replicates)
    expected = 0.8
    if not sigma_known:
        dof = (approach.n_conditions, solution.redundancy - approach.n_conditions)
        expected = ncf.sf(f.isf(0.001, *dof), *dof, found.noncentrality)
        assert expected < 0.77
    assert power == pytest.approx(expected, abs=limit)


def test_the_external_reliability_is_what_such_an_error_does():
    ideal = ideal_session().observations(Noise())
    solution = solve(NINE, GRAVITY, ideal)
    found, position = reliability(solution), 6
    error = found.mdb[position, 0] * ideal.forces[0, position] / STANDARD_GRAVITY
    moved = calibrate(NINE, GRAVITY, with_error(ideal, position, error)).parameters[0]
    change = moved - solution.parameters
    np.testing.assert_allclose(
        np.abs(change), found.parameters[position], rtol=0.01, atol=0.02 * solution.cofactors[0, 0]
    )
    f_b = cap_forces(50 * GON, 64)
    output = NINE.sense(f_b, solution.parameters)
    angles = [np.stack(roll_pitch(tuple(f.T))) for f in (NINE.correct(output, moved), f_b)]
    rms = np.sqrt(np.mean((angles[0] - angles[1]) ** 2, axis=1))
    np.testing.assert_allclose(rms, found.leveling[position], rtol=0.01)


def test_no_error_of_the_robot_in_the_ellipsoid_does_more():
    solution = solve(NINE, ROBOT, draw(2))
    found, position = reliability(solution), 3
    root = solution.whitening[position] @ solution.root[0][position]
    directions = np.random.default_rng(0).standard_normal((2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    shifts = math.sqrt(found.noncentrality) * directions @ root.T
    size = np.linalg.norm(shifts, axis=1)
    low, high = found.mdb[position, [0, -1]]
    assert low * (1 - 1e-9) <= size.min() < 1.05 * low
    assert 0.95 * high < size.max() <= high * (1 + 1e-9)
    a = solution.design[3 * position : 3 * position + 3]
    effect = solution.cofactors @ a.T @ np.linalg.solve(solution.whitening[position], shifts.T)
    largest = np.abs(effect).max(axis=1)
    assert np.all(largest <= found.parameters[position] * (1 + 1e-9))
    assert np.all(largest > 0.95 * found.parameters[position])


def test_nothing_is_detectable_without_redundancy():
    observed = draw(1, "d-optimal-9")
    solution = solve(NINE, GRAVITY, observed)
    found, tests = reliability(solution), position_tests(solution)
    for values in (found.mdb, found.parameters, found.leveling):
        assert np.isinf(values).all()
    assert (tests.dof == 0).all()
    for values in (tests.p_known, tests.p_unknown, tests.p_adjusted()):
        assert np.isnan(values).all()
    assert tests.worst() is None
    assert suspects(NINE, GRAVITY, observed) == ()
    assert held_out(NINE, GRAVITY, observed) is None

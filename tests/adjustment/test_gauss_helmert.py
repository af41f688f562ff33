"""The general adjustment, held against published solutions of reference problems.

The line of Pearson with York's weights (both coordinates observed) and the implicit ellipse of
ODRPACK; and what the adjustment promises of batches, correlated observations, observed parameters
and failures.
"""

import numpy as np
import pytest
from function_conditions import FunctionConditions

from accelstudy.adjustment import adjust, gauss_helmert


@pytest.fixture
def all_digits(monkeypatch):
    """Iterate until published digits can be compared, beyond what the default stops at."""
    monkeypatch.setattr(gauss_helmert, "STEP_TOLERANCE", 1e-11)


# --- Pearson's line with York's weights ----------------------------------------------------------

PEARSON = np.array(
    [
        [0.0, 0.9, 1.8, 2.6, 3.3, 4.4, 5.2, 6.1, 6.5, 7.4],
        [5.9, 5.4, 4.4, 4.6, 3.5, 3.7, 2.8, 2.8, 2.4, 1.5],
    ]
).T
YORK_WEIGHTS = np.array(
    [[1000, 1000, 500, 800, 200, 80, 60, 20, 1.8, 1], [1, 1.8, 4, 8, 20, 20, 70, 70, 100, 500]]
).T
YORK_COFACTORS = 1 / YORK_WEIGHTS
YORK = [5.479910224, -0.480533407]
YORK_OMEGA = 11.866353194

# a + b x - y = 0, a block for each point
LINE = FunctionConditions(lambda x, l: x[:, None, :1] + x[:, None, 1:] * l[..., :1] - l[..., 1:])


def york(observations=PEARSON[None], cofactors=YORK_COFACTORS, initial=(5.0, -0.5), **more):
    return adjust(LINE, observations, cofactors, initial, **more)


def line_as_one_block(x, l):
    """The conditions of the line with all observations in a single block, (R, 1, 20)."""
    return LINE.psi(x, l.reshape(len(l), 10, 2)).reshape(len(l), 1, -1)


@pytest.mark.usefixtures("all_digits")
def test_york_line_is_the_published_one():
    result = york()
    assert result.converged.all()
    assert result.redundancy == 8
    np.testing.assert_allclose(result.parameters[0], YORK, rtol=0, atol=1e-9)
    assert result.omega[0] == pytest.approx(YORK_OMEGA, abs=2e-9)
    np.testing.assert_allclose(result.sigma_priori[0], [0.29497074, 0.05798501], rtol=2e-8)
    np.testing.assert_allclose(result.sigma_posteriori[0], [0.35924652, 0.07062027], rtol=2e-8)
    assert result.cofactors[0, 0, 1] == pytest.approx(-0.01647254, abs=1e-8)
    assert result.variance_posteriori[0] == pytest.approx(YORK_OMEGA / 8, rel=1e-9)


@pytest.mark.parametrize("initial", [(5.0, -0.5), (0.0, 0.0), (10.0, -3.0)])
def test_the_default_stops_at_a_millionth_of_sigma_from_any_start(initial):
    """Residuals fulfil the conditions and have the Ω that is said."""
    result = york(initial=initial)
    assert np.abs((result.parameters[0] - YORK) / result.sigma_priori[0]).max() < 1e-6
    assert np.abs(LINE.psi(result.parameters, PEARSON + result.residuals)).max() < 1e-9
    assert result.omega[0] == pytest.approx(np.sum(YORK_WEIGHTS * result.residuals[0] ** 2))


def test_residuals_converge_even_where_the_parameters_are_found_at_once():
    """x = l₁ needs no iteration; the foot of the perpendicular of (l₂, l₃) on a circle does."""
    circle = FunctionConditions(
        lambda x, l: np.stack([x[:, :1] - l[..., 0], l[..., 1] ** 2 + l[..., 2] ** 2 - 1], -1)
    )
    l = np.array([[[5.0, 3.0, 4.0]]])
    result = adjust(circle, l, np.ones((1, 3)), [0.0])
    np.testing.assert_allclose(l + result.residuals, [[[5.0, 0.6, 0.8]]], rtol=1e-9)
    assert result.omega[0] == pytest.approx(4**2, rel=1e-9)


# --- cofactor matrices and dense blocks ----------------------------------------------------------


def test_correlated_observations_equal_transformed_uncorrelated_ones():
    """With l = C z and uncorrelated z, the conditions in z have the cofactors C Cᵀ in l."""
    rng = np.random.default_rng(1)
    c = np.diag(np.sqrt(YORK_COFACTORS.ravel())) @ (np.eye(20) + rng.uniform(-0.2, 0.2, (20, 20)))
    in_l = FunctionConditions(line_as_one_block)
    in_z = FunctionConditions(lambda x, z: line_as_one_block(x, z @ c.T))
    l = PEARSON.reshape(1, 1, 20)
    correlated = adjust(in_l, l, (c @ c.T)[None], [5.0, -0.5])
    transformed = adjust(in_z, l @ np.linalg.inv(c).T, np.ones((1, 20)), [5.0, -0.5])
    assert correlated.converged.all()
    assert np.abs(correlated.parameters[0] - YORK).max() > 1e-2  # the correlations matter
    np.testing.assert_allclose(correlated.parameters, transformed.parameters, rtol=1e-9)
    np.testing.assert_allclose(correlated.cofactors, transformed.cofactors, rtol=1e-8)
    np.testing.assert_allclose(correlated.omega, transformed.omega, rtol=1e-9)
    v = correlated.residuals[0, 0]
    assert v @ np.linalg.solve(c @ c.T, v) == pytest.approx(correlated.omega[0], rel=1e-9)


# --- observed parameters -------------------------------------------------------------------------


def test_an_observed_parameter_equals_an_added_condition():
    slope, variance = -0.6, 0.03**2
    direct = york(
        parameter_observations=[[0.0, slope]], parameter_weights=np.array([0.0, 1 / variance])
    )
    added = FunctionConditions(
        lambda x, l: np.concatenate(
            [line_as_one_block(x, l[..., :20]), x[:, None, 1:] - l[..., 20:]], axis=2
        )
    )
    l = np.append(PEARSON.ravel(), slope).reshape(1, 1, 21)
    q = np.diag(np.append(YORK_COFACTORS.ravel(), variance))[None]
    condition = adjust(added, l, q, [5.0, -0.5])

    assert direct.redundancy == condition.redundancy == 9
    np.testing.assert_allclose(direct.parameters, condition.parameters, rtol=1e-9)
    np.testing.assert_allclose(direct.cofactors, condition.cofactors, rtol=1e-9)
    np.testing.assert_allclose(direct.omega, condition.omega, rtol=1e-9)
    of_points = np.sum(YORK_WEIGHTS * direct.residuals[0] ** 2)
    of_slope = (direct.parameters[0, 1] - slope) ** 2 / variance
    assert direct.omega[0] == pytest.approx(of_points + of_slope, rel=1e-9)


# --- batches and failures ------------------------------------------------------------------------


def noisy_lines(replicates, seed=0):
    rng = np.random.default_rng(seed)
    noise = np.sqrt(YORK_COFACTORS) * rng.standard_normal((replicates, 10, 2))
    return PEARSON + 0.3 * noise


def assert_no_result(result, i):
    assert not result.converged[i]
    for name in ("parameters", "residuals", "cofactors", "omega", "sigma_posteriori"):
        assert np.isnan(getattr(result, name)[i]).all()


def test_a_singular_or_absurd_replicate_harms_no_other():
    """It is flagged where it has no solution, and does not loosen the convergence of others."""
    lines, others = noisy_lines(4), [0, 1, 3]
    singular, absurd = lines.copy(), lines.copy()
    singular[2, :, 0] = 3.0  # a vertical line has no intercept and slope
    absurd[2] = 1e12 * lines[2]
    expected = york(lines)
    for spoilt in (singular, absurd):
        result = york(spoilt)
        assert result.converged[others].all()
        assert result.iterations[others].tolist() == expected.iterations[others].tolist()
        np.testing.assert_allclose(
            result.parameters[others], expected.parameters[others], rtol=1e-12
        )
    result = york(singular)
    assert result.singular.tolist() == [False, False, True, False]
    assert_no_result(result, 2)


def test_a_replicate_that_does_not_converge_is_flagged():
    result = york(noisy_lines(3), max_iterations=1)
    assert result.iterations.tolist() == [1, 1, 1]
    assert not result.singular.any()
    for i in range(3):
        assert_no_result(result, i)


# --- implicit ellipse of ODRPACK -----------------------------------------------------------------

# Boggs et al. (1992), User's Reference Guide for ODRPACK, p. 49.
# fmt: off
ELLIPSE_POINTS = np.array([
    [0.5, 1.2, 1.6, 1.86, 2.12, 2.36, 2.44, 2.36, 2.06, 1.74,
     1.34, 0.9, -0.28, -0.78, -1.36, -1.9, -2.5, -2.88, -3.18, -3.44],
    [-0.12, -0.6, -1.0, -1.4, -2.54, -3.36, -4.0, -4.75, -5.25, -5.64,
     -5.97, -6.32, -6.44, -6.44, -6.41, -6.25, -5.88, -5.5, -5.24, -4.86],
]).T
# fmt: on
ELLIPSE_START = [-1.0, -3.0, 0.09, 0.02, 0.08]


def ellipse(x, l):
    b0, b1, b2, b3, b4 = (column[:, None] for column in x.T)
    dx, dy = l[..., 0] - b0, l[..., 1] - b1
    return (b2 * dx**2 + 2 * b3 * dx * dy + b4 * dy**2 - 1)[..., None]


def test_implicit_ellipse_of_odrpack():
    conditions = FunctionConditions(ellipse)
    result = adjust(conditions, ELLIPSE_POINTS[None], np.ones((20, 2)), ELLIPSE_START)
    assert result.redundancy == 15
    np.testing.assert_allclose(
        result.parameters[0],
        [-0.9993809167, -2.9310484652, 0.0875730503, 0.0162299709, 0.0797537983],
        rtol=0,
        atol=2e-6,
    )
    np.testing.assert_allclose(
        result.sigma_posteriori[0],
        [0.1113840353, 0.1097673311, 0.0041060738, 0.0027500348, 0.0034962502],
        rtol=0,
        atol=2e-5,
    )

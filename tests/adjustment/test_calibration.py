"""The calibration of an accelerometer: its equations, its estimates and their statistics.

Derivatives against finite differences, the robot adjustment against the paper's own equations,
invariances, and a seeded Monte Carlo against closed forms and published numbers. Limits
of statistical assertions are 4.5 standard errors.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import roll_and_pitch
from function_conditions import FunctionConditions
from hypothesis import given
from hypothesis import strategies as st
from quality_helpers import TRUTH, draw, ideal_session
from scipy.spatial.transform import Rotation
from scipy.stats import kstest, norm, t
from usual import BOTH, GRAVITY, NINE, ROBOT, STANDARD_ERRORS, G

from accelstudy.adjustment import CalibrationEquations, adjust, calibrate
from accelstudy.basics.errors import InputError
from accelstudy.leveling.angles import specific_force
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import MODELS, get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise, session

X = NINE.vector(TRUTH)


def simulate(approach, replicates, seed, scheme="mclaren-24", noise=None):
    return calibrate(NINE, approach, draw(seed, scheme, noise=noise, replicates=replicates))


# --- derivatives ---------------------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize("estimates_gravity", [False, True])
@pytest.mark.parametrize("name", MODELS)
def test_derivatives_against_finite_differences(name, approach, estimates_gravity):
    model = get_model(name)
    ideal, truth = ideal_session(model=model), model.vector(TRUTH)
    rng = np.random.default_rng(3)
    forces = ideal.forces + 0.01 * rng.standard_normal(ideal.forces.shape)
    l = np.concatenate([forces, ideal.angles], axis=1)[:, : 5 if approach.uses_angles else 3]
    x = np.append(truth, G) if estimates_gravity else truth

    def psi(x, l):
        """The conditions from their definition: in the output where the force is told."""
        parameters, g = (x[:-1], x[-1]) if estimates_gravity else (x, G)
        if approach is ROBOT:
            told = np.stack(specific_force(*l[:, 3:].T, g), axis=-1)
            return (l[:, :3] - model.sense(told, parameters, g)).T
        f_b = model.correct(l[:, :3], parameters, g)
        return np.stack(approach.conditions(tuple(f_b.T), (), g, np))

    def central(function, at, i):
        step = np.zeros_like(at)
        step[..., i] = 1e-5
        return (function(at + step) - function(at - step)) / 2e-5

    a = np.stack([central(lambda x: psi(x, l), x, i) for i in range(len(x))], axis=1)
    b = np.stack([central(lambda l: psi(x, l), l, i) for i in range(l.shape[1])], axis=1)

    equations = CalibrationEquations(model.trace, approach, estimates_gravity)
    f_a = model.correct(l[:, :3], truth) @ np.linalg.inv(model.axes_matrix(truth)).T
    at = equations.at(model.settings, G, ideal.hold).linearise(
        x[:, None], l.T[:, None], f_a.T[:, None]
    )
    np.testing.assert_allclose(at.psi[:, 0], psi(x, l), rtol=0, atol=1e-13 * G)
    np.testing.assert_allclose(at.jac_parameters[:, :, 0], a, rtol=0, atol=1e-6)
    np.testing.assert_allclose(at.jac_observations[:, :, 0], b, rtol=0, atol=1e-6)


# --- the robot's conditions in components are those of the paper ---------------------------------


def paper_conditions(x, l):
    """Eq. (10) with the sign of eq. (6), for the 9-parameter model; roll residuals are small."""
    f_x, f_y, f_z = np.moveaxis((l[..., :3] - x[:, None, :3]) / (1 + x[:, None, 3:6]), -1, 0)
    yz, zy, zx = np.moveaxis(x[:, None, 6:], -1, 0)
    x, y, z = f_x - yz * f_y + zy * f_z, f_y - zx * f_z, f_z  # by T of eq. (4)
    sin, cos = np.sin(l[..., 3]), np.cos(l[..., 3])
    roll = np.arctan((z * sin - y * cos) / (-z * cos - y * sin))  # of the force, less that read
    pitch = np.arctan(x / np.sqrt(y**2 + z**2))
    return np.stack([roll, pitch - l[..., 4], np.sqrt(x**2 + y**2 + z**2) - G], axis=-1)


def test_robot_adjustment_is_that_of_the_papers_equations():
    noise = Noise()
    ideal = ideal_session()
    # Turn the first position upside down: the noise scatters its roll about ±200 gon.
    scheme = get_scheme("mclaren-24").rotated([ideal.angles[0, 0] - np.pi, 0, 0])
    ideal = session(NINE, X, scheme.directions)
    observed = ideal.draw(noise, 20, np.random.default_rng(10))
    observed = replace(observed, angles=(observed.angles + np.pi) % (2 * np.pi) - np.pi)
    of_forces = roll_and_pitch(observed.forces)[..., 0]
    assert np.abs(of_forces - observed.angles[..., 0]).max() > 6  # wrapping matters
    components = calibrate(NINE, ROBOT, observed)
    l = np.concatenate([observed.forces, observed.angles], axis=-1)
    q = np.tile(np.r_[np.full(3, noise.sigma_force), np.full(2, noise.sigma_angle)] ** 2, (24, 1))
    paper = adjust(FunctionConditions(paper_conditions), l, q, np.zeros(9))

    assert components.converged.all()
    assert paper.converged.all()
    assert components.redundancy == paper.redundancy == 63
    sigma = components.sigma_priori
    assert np.abs((components.parameters - paper.parameters) / sigma).max() < 1e-5
    assert np.abs((components.residuals - paper.residuals) / np.sqrt(q)).max() < 1e-5
    np.testing.assert_allclose(components.omega, paper.omega, rtol=1e-8)
    np.testing.assert_allclose(components.sigma_priori, paper.sigma_priori, rtol=1e-6)
    correlation = [r.cofactors / (sigma[:, None] * sigma[..., None]) for r in (components, paper)]
    np.testing.assert_allclose(*correlation, atol=1e-6)


# --- Monte Carlo ---------------------------------------------------------------------------------

REPLICATES = 2000


@pytest.mark.parametrize(("approach", "scheme"), [
    (GRAVITY, "mclaren-24"),
    (ROBOT, "faces-edges-18"),  # at the poles, too: two faces have the x axis vertical
], ids=["gravity", "robot"])  # fmt: skip
def test_estimates_scatter_as_the_adjustment_says(approach, scheme):
    """Of 2000 sessions: no bias, sigmas a priori and a posteriori, and Ω of χ²."""
    result = simulate(approach, REPLICATES, 2018, scheme)
    assert result.converged.all()
    errors = (result.parameters - X) / result.sigma_priori
    # The paper's numbers leave a non-linear bias far below this.
    assert np.abs(errors.mean(axis=0)).max() < STANDARD_ERRORS / math.sqrt(REPLICATES)
    limit = STANDARD_ERRORS / math.sqrt(2 * REPLICATES)
    np.testing.assert_allclose(errors.std(axis=0), 1, rtol=0, atol=limit)
    r = result.redundancy
    assert result.omega.mean() == pytest.approx(r, abs=limit * 2 * math.sqrt(r))
    assert kstest(result.omega, "chi2", args=(r,)).pvalue > 1e-4
    limit = STANDARD_ERRORS * math.sqrt(0.95 * 0.05 / REPLICATES)
    quantiles = {"sigma_priori": norm.ppf(0.975), "sigma_posteriori": t.ppf(0.975, r)}
    for name, quantile in quantiles.items():
        inside = np.abs(result.parameters - X) < quantile * getattr(result, name)
        np.testing.assert_allclose(inside.mean(axis=0), 0.95, rtol=0, atol=limit)


# --- gravity as an observation -------------------------------------------------------------------


@BOTH
def test_a_wrong_gravity_is_a_common_scale_and_nothing_else(approach):
    observed = ideal_session().observations(Noise(gravity_error=1e-3))
    result = calibrate(NINE, approach, observed)
    expected = X.copy()
    expected[3:6] = (1 + X[3:6]) * G / (G + 1e-3) - 1
    np.testing.assert_allclose(result.parameters[0], expected, rtol=0, atol=1e-10)
    assert result.omega[0] < 1e-12


def test_gravity_that_is_held_fixed_is_one_number():
    observed = replace(draw(0, replicates=2), gravity=np.array([9.80, 9.81]))
    with pytest.raises(InputError, match="gravity differs between the sessions"):
        calibrate(NINE, GRAVITY, observed)


# --- invariances ---------------------------------------------------------------------------------

SEEDS = st.integers(0, 2**32 - 1)
LOWER = SensorModel.of("lower", ("bias", "scale", "cross_axis_misalignment"))


@given(seed=SEEDS, rotation=SEEDS)
def test_gravity_residuals_do_not_know_the_axes_of_the_sensor(seed, rotation):
    """A turned triad has another bias and another triangle T S⁻¹, but the same ellipsoid.

    So it is with the lower triangle of T, which is another gauge.
    """
    observed = draw(seed, replicates=2)
    matrix = Rotation.random(random_state=np.random.default_rng(rotation)).as_matrix()
    turned = replace(observed, forces=observed.forces @ matrix.T)
    expected = calibrate(NINE, GRAVITY, observed)
    for model, data, turn in ((NINE, turned, matrix), (LOWER, observed, np.eye(3))):
        result = calibrate(model, GRAVITY, data)
        np.testing.assert_allclose(result.omega, expected.omega, rtol=1e-9)
        residuals, centres = expected.residuals @ turn.T, expected.parameters[:, :3] @ turn.T
        np.testing.assert_allclose(result.residuals, residuals, rtol=0, atol=1e-5 * 0.002)
        np.testing.assert_allclose(result.parameters[:, :3], centres, rtol=0, atol=1e-8)


@BOTH
@given(seed=SEEDS, factor=st.floats(1e-4, 1e4))
def test_the_unit_of_force_does_not_matter(approach, seed, factor):
    observed = draw(seed, replicates=2)
    scaled = replace(
        observed,
        forces=factor * observed.forces,
        sigma_force=factor * observed.sigma_force,
        gravity=factor * observed.gravity,
    )
    result, expected = calibrate(NINE, approach, scaled), calibrate(NINE, approach, observed)
    in_si = result.parameters / np.array([factor] * 3 + [1] * 6)
    np.testing.assert_array_less(np.abs(in_si - expected.parameters), 1e-6 * expected.sigma_priori)
    np.testing.assert_allclose(result.omega, expected.omega, rtol=1e-9)

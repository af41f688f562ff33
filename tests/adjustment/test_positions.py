"""What a calibration costs grows like its positions; a diagnosis is as whole matrices say."""

import tracemalloc
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from gross import bumped
from quality_helpers import draw
from stand_ins import composed
from usual import BOTH, GRAVITY, NINE, ROBOT

import accelstudy as acs
from accelstudy.adjustment import calibrate, calibration
from accelstudy.adjustment.components import variance_components
from accelstudy.adjustment.quality import held_out, position_tests, reliability, solve, suspects
from accelstudy.approaches import get_approach
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.calibration.result import Calibration
from accelstudy.diagnosis.evidence.noise import (
    CONTRASTS,
    LENGTHS,
    LOG_RATIOS,
    STRENGTHS,
    coloured_density,
    unequal_axes_density,
)
from accelstudy.diagnosis.evidence.size import Evidence, Level, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import clusters, repeats_of
from accelstudy.simulation.sessions import Noise

FEW, MANY = 400, 1600


def peak(function):
    """Largest memory in use while a function runs, MB."""
    tracemalloc.start()
    function()
    size = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return size / 1e6


@pytest.mark.parametrize("sigma_gravity", [0.0, 1e-3])
def test_variance_components_solve_their_equations_with_whole_matrices(sigma_gravity):
    """S θ = q − S₀ with W, M_i and M₀ as they are defined, at the factors that were found."""
    noise = Noise(sigma_gravity=sigma_gravity)
    observed = draw(3, "fibonacci-40", noise=noise)
    found = variance_components(NINE, ROBOT, observed)
    assert found.converged
    force, angle = np.sqrt(found.factors)
    solution = solve(
        NINE,
        ROBOT,
        replace(
            observed, sigma_force=force * noise.sigma_force, sigma_angle=angle * noise.sigma_angle
        ),
    )
    n, c, u = solution.jac_parameters.shape
    size = n * c + len(solution.prior[1])
    m = np.zeros((3, size, size))
    for i, columns in enumerate((slice(0, 3), slice(3, 5))):
        b = solution.jac_observations[:, :, columns]
        q = solution.variances[:, columns] / found.factors[i]
        for k, block in enumerate(np.einsum("nco,no,ndo->ncd", b, q, b)):
            m[i, k * c : (k + 1) * c, k * c : (k + 1) * c] = block
    m[2, n * c :, n * c :] = np.eye(size - n * c)
    a = np.concatenate([solution.jac_parameters.reshape(n * c, u), solution.prior[0]])
    w = np.concatenate([solution.misclosures.ravel(), solution.prior[1]])
    inverse = np.linalg.inv(found.factors[0] * m[0] + found.factors[1] * m[1] + m[2])
    scale = np.linalg.norm(a, axis=0)
    a = a / scale
    projected = inverse - inverse @ a @ np.linalg.solve(a.T @ inverse @ a, a.T @ inverse)
    s = np.array([[np.trace(projected @ i @ projected @ j) for j in m] for i in m[:2]])
    shares = np.array([w @ projected @ i @ projected @ w for i in m[:2]])
    # The derivatives belong to weights that differ from these by the limit of convergence.
    np.testing.assert_allclose(s[:, :2] @ found.factors + s[:, 2], shares, rtol=2e-3)
    np.testing.assert_allclose(
        found.sigma, np.sqrt(np.diag(2 * np.linalg.inv(s[:, :2]))), rtol=1e-3
    )


@BOTH
def test_sessions_that_are_adjusted_in_parts_are_the_same(approach, monkeypatch):
    observed = draw(3, replicates=7, noise=Noise(sigma_gravity=1e-3))
    whole = calibrate(NINE, approach, observed)
    monkeypatch.setattr(calibration, "AT_ONCE", 2 * 24 + 5)
    parts = calibrate(NINE, approach, observed)
    np.testing.assert_allclose(parts.parameters, whole.parameters, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(parts.iterations, whole.iterations)
    assert parts.redundancy == whole.redundancy


@pytest.mark.parametrize("approach", [GRAVITY, ROBOT], ids=lambda a: a.name)
def test_memory_of_the_quality_is_linear_in_the_positions(approach):
    def assess(n):
        observed = draw(3, f"fibonacci-{n}")
        solution = solve(NINE, approach, observed)
        solution.redundancy_numbers.sum()
        position_tests(solution)
        reliability(solution)
        suspects(NINE, approach, observed)
        held_out(solution)
        variance_components(NINE, approach, observed)

    assert peak(lambda: assess(MANY)) < 1.3 * MANY / FEW * peak(lambda: assess(FEW))


def test_a_page_of_many_positions_lists_those_that_fit_worst(tmp_path):
    campaign = bumped(acs.simulate_campaign(seed=3, scheme="fibonacci-1200"), 77)
    fit = fit_campaign(campaign, NINE, ROBOT)
    with composed("residuals"):
        Calibration(fit).write(tmp_path, tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "200 of 1200 positions that fit worst" in page
    assert '<tr class="suspect"><td>77</td>' in page
    # The points are one image within the figure.
    assert "<image" in (tmp_path / "figures" / "residuals.svg").read_text()
    assert len(page) < 500_000


# --- the diagnosis -------------------------------------------------------------------------------


def complement(columns):
    """Orthonormal basis of all that is orthogonal to columns."""
    return np.linalg.qr(columns, mode="complete")[0][:, columns.shape[1] :]


@pytest.fixture(scope="module", params=["gravity", "robot"])
def frame(request):
    """A campaign with a repeated scheme, all columns and observed gravity."""
    campaign = acs.simulate_campaign(
        seed=4, scheme="fibonacci-15", repeats=2, approach=request.param,
        temperature=(10.0, 40.0), temperature_order="random",
    )  # fmt: skip
    gravity = {"value_mps2": campaign.gravity, "sigma_mps2": 1e-3}
    fit = fit_campaign(campaign.with_header(gravity=gravity), NINE, get_approach(request.param))
    return SessionFit.of(fit.solution)


def test_residuals_are_those_of_a_basis_of_the_residual_space(frame):
    residuals = frame.residuals
    n = complement(residuals.design)
    np.testing.assert_allclose(residuals.z, n @ n.T @ residuals.errors, atol=1e-9)
    assert residuals.redundancy == n.shape[1]
    rows = np.random.default_rng(1).standard_normal((len(n), 4))
    np.testing.assert_allclose(residuals.project(rows), n @ n.T @ rows, atol=1e-12)
    errors = residuals.project(rows)
    for shapes in frame.candidates.values():
        for h, part in zip(shapes, shapes.parts(errors.T).T, strict=True):
            np.testing.assert_allclose(h.basis.T @ h.basis, np.eye(h.dim), atol=1e-9)
            np.testing.assert_allclose(residuals.absorbed.T @ h.basis, 0, atol=1e-9)
            np.testing.assert_allclose(part, np.sum((h.basis.T @ errors) ** 2, axis=0), rtol=1e-7)


def test_repeats_and_lack_of_fit_share_the_residual_space(frame):
    """Against a basis of all differences between conditions of one attitude."""
    residuals = frame.residuals
    n, c = residuals.whitening.shape[:2]
    labels = clusters(frame.forces)
    assert len(np.unique(labels)) == n / 2
    differences = []
    for i in range(n):
        for axis in range(c if labels[i] != i else 0):
            change = np.zeros((n, c, 1))
            change[i, axis], change[labels[i], axis] = 1, -1
            differences.append(residuals.stack(np.linalg.solve(residuals.whitening, change)))
    basis = np.linalg.qr(residuals.project(np.concatenate(differences, axis=1)))[0]
    same = repeats_of(residuals, frame.forces)
    errors = residuals.project(np.random.default_rng(1).standard_normal((len(residuals.z), 5))).T
    repeated = np.sum((errors @ basis) ** 2, axis=1)
    assert same.dims[0] == residuals.redundancy - basis.shape[1]
    rest = np.sum(errors**2, axis=1) - repeated
    np.testing.assert_allclose(same.parts(errors)[:, 0], rest, rtol=1e-9)


def test_coloured_noise_has_the_likelihood_of_whole_covariance_matrices(frame):
    residuals = frame.residuals
    n, c = residuals.whitening.shape[:2]
    basis, i = complement(residuals.design), np.arange(n)
    z, r = basis.T @ residuals.z, residuals.redundancy
    g = np.einsum("ncr,nca->anr", basis[: n * c].reshape(n, c, -1), residuals.force_noise)
    evidence = Evidence(Level.of_stated_sigma(), r)
    found = coloured_density(residuals, evidence)
    logs = []
    for length in LENGTHS:
        lag = np.abs(i[:, None] - i)
        kernel = np.exp(-lag / length) if length < np.inf else (np.minimum(i[:, None], i) + 1) / n
        for strength in STRENGTHS:
            covariance = np.eye(r) + strength * np.einsum("anr,nm,ams->rs", g, kernel, g)
            square = z @ np.linalg.solve(covariance, z)
            determinant = np.linalg.slogdet(covariance)[1]
            logs.append(np.logaddexp.reduce(evidence.noise_density(square, determinant)))
    assert found == pytest.approx(log_mean(np.array(logs)), rel=1e-9)


def test_unequal_axes_have_the_likelihood_of_whole_covariance_matrices(frame):
    residuals, r = frame.residuals, frame.residuals.redundancy
    n, c = residuals.whitening.shape[:2]
    basis = complement(residuals.design)
    z = basis.T @ residuals.z
    g = np.einsum("ncr,nca->arn", basis[: n * c].reshape(n, c, -1), residuals.force_noise)
    evidence, logs, prior = Evidence(Level.of_stated_sigma(), r), [], []
    for contrasts in product(LOG_RATIOS, LOG_RATIOS):
        ratios = np.exp(np.array(contrasts) @ CONTRASTS)
        covariance = np.eye(r) + sum((k - 1) * a @ a.T for k, a in zip(ratios, g, strict=True))
        square, determinant = z @ np.linalg.solve(covariance, z), np.linalg.slogdet(covariance)[1]
        logs.append(np.logaddexp.reduce(evidence.noise_density(square, determinant)))
        prior.append(np.exp(-(np.hypot(*contrasts) ** 2) / (2 * RULES.spread_axes**2)))
    found = unequal_axes_density(residuals, evidence, None)
    assert found == pytest.approx(float(log_mean(np.array(logs), prior)), abs=1e-8)

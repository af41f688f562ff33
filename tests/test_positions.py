"""What a calibration costs grows like its number of positions, and not like its square."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from quality_helpers import BOTH, GRAVITY, NINE, ROBOT, SIGMA, draw

from accelstudy.adjustment import calibrate, calibration
from accelstudy.adjustment.quality import (
    held_out,
    position_tests,
    prediction,
    redundancy_numbers,
    reliability,
    solve,
    suspects,
    variance_components,
)
from accelstudy.campaign.fit import fit_campaign
from accelstudy.campaign.output import write_calibration
from accelstudy.campaign.simulating import CampaignSettings, simulate_campaign
from accelstudy.simulation import Noise

FEW, MANY = 400, 1600


def dense_projector(solution):
    """R = I − Ã (Ãᵀ Ã)⁻¹ Ãᵀ as it is defined."""
    a = solution.design
    return np.eye(len(a)) - a @ np.linalg.solve(a.T @ a, a.T)


def peak(function):
    """Largest memory in use while a function runs, MB."""
    function()  # what is made once and kept is made here
    tracemalloc.start()
    function()
    size = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return size / 1e6


@BOTH
@pytest.mark.parametrize("sigma_gravity", [0.0, 1e-3])
def test_blocks_are_those_of_the_whole_projector(approach, sigma_gravity):
    solution = solve(NINE, approach, draw(3, noise=Noise(sigma_gravity=sigma_gravity)))
    n, c = solution.misclosures.shape
    whole = dense_projector(solution)
    for i in range(n):
        at = slice(i * c, (i + 1) * c)
        np.testing.assert_allclose(solution.blocks[i], whole[at, at], rtol=0, atol=1e-12)
    gravity = redundancy_numbers(solution).gravity
    if sigma_gravity:
        assert gravity == pytest.approx(whole[-1, -1], abs=1e-12)
    assert np.trace(whole) == pytest.approx(solution.redundancy, abs=1e-9)


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
            observed,
            sigma_force=force * noise.sigma_force,
            sigma_angle=angle * noise.sigma_angle,
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
    traces = [np.trace(projected @ i) for i in m[:2]]
    np.testing.assert_allclose(found.redundancy, found.factors * traces, rtol=1e-3)


@BOTH
def test_predictions_by_derivatives_are_those_of_refits(approach, monkeypatch):
    """From so many positions on, one changes next to nothing by second order."""
    observed = draw(3, f"fibonacci-{prediction.REFITTED}", noise=Noise(sigma_gravity=1e-3))
    refitted = held_out(NINE, approach, observed)
    monkeypatch.setattr(prediction, "REFITTED", 10)
    derived = held_out(NINE, approach, observed)
    np.testing.assert_allclose(derived.misclosures, refitted.misclosures, rtol=0, atol=2e-4 * SIGMA)
    np.testing.assert_allclose(derived.cofactors, refitted.cofactors, rtol=0, atol=5e-4 * SIGMA**2)
    if approach is ROBOT:
        np.testing.assert_allclose(derived.angles, refitted.angles, rtol=0, atol=1e-7)


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
        redundancy_numbers(solution)
        position_tests(solution)
        reliability(solution)
        suspects(NINE, approach, observed)
        held_out(NINE, approach, observed)
        variance_components(NINE, approach, observed)

    assert peak(lambda: assess(MANY)) < 1.3 * MANY / FEW * peak(lambda: assess(FEW))


def test_a_page_of_many_positions_lists_those_that_fit_worst(tmp_path):
    campaign, _ = simulate_campaign(
        CampaignSettings(
            seed=3, scheme="fibonacci-1200", gross_errors=("outlier_position(position=77)",)
        )
    )
    fit = fit_campaign(campaign, NINE, ROBOT)
    write_calibration(fit, tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "200 positions of 1200 that fit worst" in page
    assert '<tr class="suspect"><td>77</td>' in page
    # The points are one image within the figure.
    assert "<image" in (tmp_path / "figures" / "residuals.svg").read_text()
    assert len(page) < 500_000

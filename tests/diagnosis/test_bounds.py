"""Physical bounds of parameters, and the uncertainty of settings: a knee in plain arithmetic."""

from dataclasses import replace

import numpy as np
import pytest
from campaign_helpers import made

from accelstudy.approaches import get_approach
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.diagnosis.decision.problem import fit_base, pose
from accelstudy.diagnosis.decision.refits import best_refit, with_settings
from accelstudy.diagnosis.evidence.bounds import box_probability
from accelstudy.diagnosis.evidence.candidates import Cause, weigh_singles
from accelstudy.effects import get_effect
from accelstudy.sensors.models import get_model
from accelstudy.sensors.plausibility import impossible_parameters

G, SIGMA, N = STANDARD_GRAVITY, 2e-3, 36
BIAS, SCALE = np.array([0.1, -0.05, 0.2]), np.array([0.01, -0.02, 0.015])


def saturated(k, knee, seed):
    """Readings of a sensor in random attitudes that loses k of what is beyond a knee."""
    rng = np.random.default_rng(seed)
    directions = rng.standard_normal((N, 3))
    force = G * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    read = BIAS + (1 + SCALE) * force
    read -= k * np.sign(read) * np.maximum(np.abs(read) - knee, 0)
    return made(read + SIGMA * rng.standard_normal((N, 3)), G, SIGMA)


def weighed(campaign):
    problem = pose(fit_base(campaign, get_model("bias-scale"), get_approach("gravity")))
    return problem, weigh_singles(problem.frame, problem.evidence)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_probability_of_a_box_is_that_of_drawn_numbers(d):
    rng, count = np.random.default_rng(d), 200_000
    sigma, mean = rng.uniform(0.5, 2, d), rng.uniform(0, 1, d)
    drawn = mean + sigma * rng.standard_normal((count, d))
    for low, high in ((0.0, 1.0), (0.0, np.inf), (-np.inf, np.inf)):
        share = np.mean(np.all((low <= drawn) & (drawn <= high), axis=1))
        found = box_probability(mean, np.diag(sigma**2), low, high)
        assert found == pytest.approx(share, abs=4 * np.sqrt(0.25 / count) + 0.01 * share)


def test_far_from_a_box_its_probability_keeps_its_digits():
    """20 sigma below and above: φ(x)/x (1 − 1/x² + 3/x⁴ …)."""
    x = 20.0
    expected = np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi) / x * (1 - x**-2 + 3 * x**-4)
    for mean in (-x, x + 1):
        found = box_probability(np.array([mean]), np.eye(1), 0.0, 1.0)
        assert found == pytest.approx(expected, rel=1e-4)


def test_a_saturation_that_gains_has_no_evidence():
    """The same size, once as a loss and once as a gain: the loss wins what the gain loses."""
    loss, gain = (weighed(saturated(k, 0.75 * G, 5))[1].densities for k in (0.04, -0.04))
    assert loss["saturation"] - loss["cubic_scale"] > 20
    assert gain["saturation"] - gain["cubic_scale"] < -20


def test_what_is_beyond_its_bounds_is_said():
    effects, sigma = (get_effect("saturation"),), np.full(3, 1e-3)
    (said,) = impossible_parameters(effects, np.array([-2e-3, 0.3, -0.02]), sigma)
    assert said == "k_sat_z = −20000 ppm (0 … 1000000 is possible)"
    assert not impossible_parameters(effects, np.array([0.0, 1.002, 0.5]), sigma)


def test_the_uncertainty_of_a_knee_is_in_all_sigmas():
    """Cofactors of parameters and knee, from the norm of what readings are corrected to."""
    campaign = saturated(np.array([0.1, 0.06, 0.12]), 8.8, 2)
    problem, singles = weighed(campaign)
    cause = Cause("saturation", ("saturation",), singles.best["saturation"])
    (found,), fit = best_refit(singles, [cause])
    chosen = found.shape
    assert fit.model.parameter_names[6:] == ("k_sat_x", "k_sat_y", "k_sat_z")

    def norm(p, read):
        bias, scale, k, knee = p[:3], p[3:6], p[6:9], np.exp(p[9])
        beyond = np.maximum(np.abs(read) - knee, 0)
        return np.linalg.norm(
            (read + np.sign(read) * beyond * k / (1 - k) - bias) / (1 + scale), axis=1
        )

    p = np.append(fit.parameters, np.log(chosen.value))
    read = campaign.forces + fit.residuals
    slope = np.stack([(norm(p + h, read) - norm(p - h, read)) / 2e-6 for h in 1e-6 * np.eye(10)])
    by_read = np.stack([(norm(p, read + h) - norm(p, read - h)) / 2e-6 for h in 1e-6 * np.eye(3)])
    white = slope / (SIGMA * np.linalg.norm(by_read, axis=0))
    tried = [h.value for h in problem.frame.candidates["saturation"].hypotheses]
    normal = white @ white.T
    normal[9, 9] += 12 / np.log(max(tried) / min(tried)) ** 2
    expected = np.sqrt(np.diag(np.linalg.inv(normal)))
    found = np.sqrt(np.diag(with_settings(problem.frame, fit, [chosen])))
    np.testing.assert_allclose(found, expected, rtol=0.02)
    np.testing.assert_allclose(np.sqrt(np.diag(fit.cofactors)), found[:9], rtol=1e-12)
    without = np.sqrt(np.diag(np.linalg.inv(white[:9] @ white[:9].T)))
    assert np.max(found[6:9] / without[6:9]) > 1.3
    # Where the sensor loses more than what is beyond the knee, a reading may have no force.
    folded = replace(fit, parameters=np.where(np.arange(9) == 6, 1.5, fit.parameters))
    unknown = with_settings(problem.frame, folded, [chosen])
    np.testing.assert_array_equal(unknown[:9, :9], fit.cofactors)
    assert np.isnan(unknown[9, 9])


def test_of_effects_that_are_the_same_here_one_is_fitted_whose_size_a_sensor_can_have():
    """It became warmer by 25 K within five minutes: a drift would be a hundred times as usual."""
    warm = np.linspace(0, 1, N)[:, None]
    forces = saturated(0.0, G, 6).forces + 25e-3 * warm * [3, -2, 4]
    times = {"time": 300 * warm[:, 0], "temperature": 15 + 25 * warm[:, 0]}
    _, singles = weighed(made(forces, G, SIGMA, **times))
    cause = Cause("bias_drift", singles.members["bias_drift"], singles.best["bias_drift"])
    assert [one.name for one in best_refit(singles, [cause]).causes] == ["thermal_bias"]

"""Slopes within the holds: what they tell of effects of time, and what they do not claim."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_helpers import GRAVITY, NINE, ROBOT

from accelstudy.adjustment.quality import solve
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.space.examined import Frame, examine
from accelstudy.diagnosis.space.signatures import signature, temperature_rate
from accelstudy.diagnosis.space.slopes import Slopes, trimmed_mean_square
from accelstudy.effects import HoldConditions, effect_names, get_effect
from accelstudy.sensors.models import compose

FIRST, LATER, GAP, WHITE = 90.0, 10.0, 5.0, 0.012
"""A first hold of so many s, then others; white noise of the samples, m/s² in 1 s."""


def session(seed=1, approach="gravity", first=FIRST, scatter=1.0, **keys):
    """A campaign of 24 holds with slopes, and the durations of its holds."""
    keys = {"sigma": 0.004, "interval": LATER + GAP, **keys}
    campaign, _ = simulate_campaign(CampaignSettings(seed=seed, approach=approach, **keys))
    n = campaign.n_positions
    duration = np.where(np.arange(n) == 0, first, LATER)
    time = np.cumsum(duration + GAP) - GAP - duration / 2
    sd = np.broadcast_to((np.sqrt(12) * WHITE / duration**1.5)[:, None], (n, 3))
    noise = scatter * np.random.default_rng(seed + 1000).standard_normal((n, 3))
    return replace(campaign, time=time, slope=sd * noise, sd_slope=sd), duration


def settling(seed, tau=100.0):
    """A sensor that settles: |f| rises by 17 mm/s² a minute in the first hold; K2 is weak."""
    campaign, duration = session(seed)
    along = campaign.forces[0] / np.linalg.norm(campaign.forces[0])
    rate = 17e-3 / 60 * np.exp(-(campaign.time - campaign.time[0]) / tau)[:, None] * along
    half = duration[:, None] / 2 / tau
    even = 6e-4 * np.array([1, -1, 0.5]) * campaign.forces**2 / campaign.gravity
    return replace(
        campaign,
        forces=campaign.forces - tau * rate * np.sinh(half) / half + even,
        slope=campaign.slope + rate,
    )


def frame(campaign, model=NINE):
    approach = GRAVITY if campaign.angles is None else ROBOT
    fit = fit_campaign(campaign, model, approach)
    return Frame.of(solve(fit.model, fit.approach, fit.observed, fit.adjustment))


def mute(campaign):
    return replace(campaign, slope=None, sd_slope=None)


# --- rates ---------------------------------------------------------------------------------------


def rate_of(name, hold):
    forces = np.random.default_rng(1).normal(0, 5, (len(hold.time), 3))
    return signature(get_effect(name), forces, forces[:, :2] / 10, 9.8, hold).rate, forces


def test_rates_are_derivatives_of_the_definition_by_time():
    time = 60.0 * np.arange(12)
    still = dict.fromkeys(("vibration", "roll", "pitch", "yaw"), 0 * time)
    hold = HoldConditions(time=time, temperature=20 + 0.01 * time, **still)
    hold = hold.with_steps(np.eye(12, 3))
    eye = np.eye(3)
    expected = {
        "bias_drift": np.ones(12),
        "warm_up(tau=300)": -np.exp(-time / 300) / 300,
        "thermal_bias": np.full(12, 0.01),
    }
    for spec, values in expected.items():
        rate, _ = rate_of(spec, hold)
        np.testing.assert_allclose(rate, values[:, None, None] * eye, rtol=1e-6)
    rate, forces = rate_of("thermal_scale", hold)
    np.testing.assert_allclose(rate, 0.01 * forces[:, :, None] * eye, rtol=1e-6)
    rate, _ = rate_of("thermal_bias(tau=120)", hold)
    behind = 0.01 * (1 - np.exp(-time / 120))
    np.testing.assert_allclose(rate, behind[:, None, None] * eye, rtol=1e-6, atol=1e-14)
    constant = set(effect_names()) - {"bias_drift", "warm_up", "thermal_bias", "thermal_scale"}
    changing = {name for name in constant if rate_of(name, hold)[0].any()}
    assert changing <= {"thermal_curve"}


@pytest.mark.parametrize(("temperature", "steady"), [
    (np.linspace(20, 40, 24), True),
    (np.round(np.linspace(20, 40, 24), 0), True),  # a coarse thermometer
    (40 - 20 * np.exp(-np.arange(24) / 8), True),
    (np.repeat([20.0, 40.0, 20.0], 8), False),
    (np.random.default_rng(2).uniform(20, 40, 24), False),
])  # fmt: skip
def test_a_temperature_that_is_set_anew_rests_within_the_holds(temperature, steady):
    rate = temperature_rate(60.0 * np.arange(24), temperature)
    assert rate.any() == steady
    if steady:
        np.testing.assert_allclose(rate[1:-1], (temperature[2:] - temperature[:-2]) / 120)


# --- rows ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("approach", ["gravity", "robot"])
def test_slopes_are_used_where_they_tell_more_than_the_means(approach):
    """In even holds the means know all of a slow change; in a long first hold the slope does."""
    campaign, _ = session(approach=approach)
    long, even = frame(campaign), frame(session(approach=approach, first=LATER)[0])
    assert even.residuals.slopes == 0
    np.testing.assert_array_equal(
        even.residuals.z, frame(mute(session(approach=approach, first=LATER)[0])).residuals.z
    )
    assert 0 < long.residuals.slopes <= long.residuals.positions.redundancy / 4
    silent = frame(mute(campaign))
    np.testing.assert_allclose(long.residuals.positions.z, silent.residuals.z, atol=1e-12)
    sizes = []
    for one in (long, silent):
        shown = one.signature(get_effect("warm_up(tau=60)"))
        sizes.append(np.linalg.norm(one.residuals.project(one.residuals.whitened(shown)), 2))
    assert sizes[0] > 1.2 * sizes[1]
    constant = long.residuals.whitened(long.signature(get_effect("cubic_scale")))
    assert not constant[-long.residuals.slopes :].any()


def test_slopes_of_the_models_own_effects_are_taken_into_account():
    """Beside a drift that the model has, a slope of the same drift is no misfit."""
    drifting = compose("drifting", (*(e.spec for e in NINE.effects), "warm_up(tau=100)"))
    campaign = settling(3)
    base, extended = frame(campaign).residuals, frame(campaign, drifting).residuals
    assert extended.slopes > 0
    assert extended.design[-extended.slopes :].any()
    assert np.abs(base.z[-base.slopes :]).max() > 3
    assert np.sum(extended.z[-extended.slopes :] ** 2) < 4 * extended.slopes
    assert extended.redundancy == len(extended.design) - 12


@pytest.mark.parametrize("scatter", [1.0, 3.0])
def test_slopes_that_scatter_more_than_they_say_are_no_evidence(scatter):
    """Rows of slopes have the variance 1 or less, and the variance factor is that of the slopes."""
    rows, factors = [], []
    for seed in range(20):
        one = frame(session(seed, scatter=scatter)[0])
        rows += one.residuals.z[len(one.residuals.z) - one.residuals.slopes :].tolist()
        factors.append(Slopes.of(one.solution.observed, one.forces).variance)
    assert np.median(factors) == pytest.approx(scatter**2, rel=0.35)
    assert np.mean(np.square(rows)) < 1.3


def test_no_turning_and_no_single_hold_counts_as_a_course():
    campaign, _ = session()
    expected = frame(campaign).residuals
    along = campaign.forces / np.linalg.norm(campaign.forces, axis=1, keepdims=True)
    turning = 0.01 * np.cross(along, np.roll(along, 1, axis=1))
    turned = frame(replace(campaign, slope=campaign.slope + turning)).residuals
    np.testing.assert_allclose(turned.z, expected.z, atol=0.05)
    slope = campaign.slope.copy()
    slope[12] += 1.0 * along[12]
    slope[17] -= 0.5 * along[17]
    moved = frame(replace(campaign, slope=slope))
    left = ~Slopes.of(moved.solution.observed, moved.forces).by_rate.any(axis=1)
    assert left.nonzero()[0].tolist() == [12, 17]
    np.testing.assert_allclose(moved.residuals.z[-1], expected.z[-1], atol=0.5)


def test_slopes_that_cannot_be_judged_are_absent():
    campaign, _ = session()
    zero = replace(campaign, sd_slope=0 * campaign.sd_slope)
    few = campaign.without(dict.fromkeys(range(13, 25), "few"))
    for one in (zero, few, replace(campaign, time=None), replace(campaign, sigma_force=None)):
        fit = fit_campaign(one, NINE, GRAVITY)
        assert Slopes.of(fit.observed, one.forces) is None


def test_a_trimmed_variance_is_that_of_normal_numbers():
    squares = np.random.default_rng(1).standard_normal((400, 15)) ** 2
    assert np.mean([trimmed_mean_square(row) for row in squares]) == pytest.approx(1, abs=0.08)


# --- the diagnosis -------------------------------------------------------------------------------


def test_a_sensor_that_settles_in_the_first_hold_is_recognised_by_its_slope():
    """What a warm-up explains, beyond what the best other effect does, grows with the slopes."""
    for seed in range(3):
        campaign, ahead = settling(seed), []
        for one in (campaign, mute(campaign)):
            fit = fit_campaign(one, NINE, GRAVITY)
            examined = examine(solve(fit.model, fit.approach, fit.observed, fit.adjustment))
            explained = {
                name: shapes.parts(examined.frame.residuals.z).max()
                for name, shapes in examined.candidates.items()
            }
            best = explained.pop("warm_up")
            ahead.append(best - max(explained.values()))
        assert ahead[0] > max(ahead[1], 0) + 4


def test_a_sensor_that_settles_is_no_noise():
    """Explanations by the noise have to leave the slopes as they are, too."""
    result = diagnose(settling(2), NINE)
    assert result.verdict == "named"
    assert [found.name for found in result.found] == ["warm_up"]


def test_without_sigma_the_slopes_are_left_out():
    campaign = replace(settling(1), sigma_force=None)
    assert diagnose(campaign, NINE).frame.residuals.slopes == 0

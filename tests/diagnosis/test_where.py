"""Where a model disagrees with a campaign: the posterior over coordinates and targets."""

import numpy as np
import pytest
from diagnosis_helpers import GRAVITY, NINE
from scipy import stats

from accelstudy.adjustment.quality import solve
from accelstudy.basics.units import GON
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.session import Campaign
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.diagnosis.space.hypotheses import LackOfFit, clusters
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.shapes import coordinate_in_holds
from accelstudy.schemes import get_scheme

PLACES = {
    "thermal_bias: 0.002, -0.002, 0.001": ("temperature", "bias"),
    "thermal_scale: 3e-4, -3e-4, 2e-4": ("temperature", "scale"),
    "warm_up(tau=600): 0.05, -0.05, 0.05": ("time", "bias"),
    "hysteresis: 0.02, 0.02, 0.02": ("previous", "bias"),
    "cubic_scale: 0.01, -0.01, 0.01": ("force", "bias"),
    "encoder_eccentricity: 1e-3, -9e-4, -9e-4, -9e-4": ("angle", "reading"),
}
"""Effects, and of what they make which part of the reading a function."""


def measured(*effects, **changes):
    settings = {"scheme": "fibonacci-36", "order": "random", "seed": 11, "temperature": (20, 40)}
    settings |= {"temperature_order": "random", "effects": effects, **changes}
    return simulate_campaign(CampaignSettings(**settings))[0]


@pytest.mark.parametrize("effect", PLACES)
def test_a_large_effect_is_confirmed_and_placed_where_its_formula_has_it(effect):
    found = diagnose(measured(effect), NINE)
    assert found.verdict == "named"
    assert found.gap.confirmed
    assert found.gap.after < 2 < found.gap.before
    assert (found.like[0].coordinate, found.like[0].target) == PLACES[effect]
    posteriors = [place.posterior for place in found.like]
    assert posteriors[0] > 0.5
    assert posteriors == sorted(posteriors, reverse=True)
    assert sum(posteriors) == pytest.approx(1)
    assert any(
        line.startswith("As a smooth function, what is missing") for line in verdict_lines(found)
    )


def test_noise_lives_nowhere():
    assert diagnose(measured(), NINE).like == ()


def test_coordinates_are_those_of_the_campaign():
    campaign = measured(yaw="random")
    frame = diagnose(campaign, NINE).frame
    for name, expected in {
        "time": campaign.time,
        "temperature": campaign.temperature,
        "yaw": campaign.yaw,
        "angle": campaign.angles,
        "move": np.diff(campaign.angles, axis=0, prepend=campaign.angles[:1]),
    }.items():
        off = coordinate_in_holds(name, frame) - np.reshape(expected, (campaign.n_positions, -1))
        # An angle may be a whole turn away.
        assert np.abs((off / (400 * GON) + 0.5) % 1 - 0.5).max() < 1e-12 or not off.any(), name
    force = coordinate_in_holds("force", frame)
    np.testing.assert_array_equal(coordinate_in_holds("previous", frame)[1:], force[:-1])
    np.testing.assert_allclose(coordinate_in_holds("next", frame)[:-1], np.diff(force, axis=0))


# --- repeats ----------------------------------------------------------------------------------


def near(directions, degrees, rng):
    """Directions turned by up to so many degrees each, evenly over the cap."""
    across = rng.standard_normal(directions.shape)
    across -= np.sum(across * directions, axis=1, keepdims=True) * directions
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    angle = np.radians(degrees) * np.sqrt(rng.random((len(directions), 1)))
    return directions * np.cos(angle) + across * np.sin(angle)


def test_repeats_by_hand_count_and_the_lack_of_fit_keeps_its_level():
    """A person turns back to within two degrees."""
    rng, values = np.random.default_rng(17), []
    for _ in range(150):
        first = near(get_scheme("faces-edges-18").directions, 5, rng)
        taken = np.concatenate([first, near(first, 2, rng)])
        forces = -9.80665 * taken * [1.004, 0.997, 1.006] + [0.12, -0.08, 0.2]
        forces += 0.002 * rng.standard_normal(forces.shape)
        measured = Campaign("by-hand", np.arange(36), forces, 9.80665, sigma_force=0.002)
        fit = fit_campaign(measured, NINE, GRAVITY)
        left = Residuals.of(solve(NINE, GRAVITY, fit.observed, fit.adjustment))
        labels = clusters(forces)
        assert len(np.unique(labels)) == 18
        same = LackOfFit.of(left, labels)
        r, in_common, freedom = left.redundancy, float(same.parts(left.z)[0]), int(same.dims[0])
        of_repeats = float(left.z @ left.z) - in_common
        ratio = in_common / freedom / (of_repeats / (r - freedom))
        values.append(stats.f.sf(ratio, freedom, r - freedom))
    assert stats.kstest(values, "uniform").pvalue > 0.001

"""Where a disagreement lives: what is told, and what a campaign cannot tell."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_helpers import GRAVITY, NINE, design, most, posed, shuffled, some_holds
from scipy import stats

from accelstudy.adjustment.quality import solve
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.session import Campaign
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.diagnosis import consequences as location
from accelstudy.diagnosis.decision.verdict import Finding
from accelstudy.diagnosis.evidence.detection import Chance
from accelstudy.diagnosis.evidence.size import Level
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.words import GROUPS
from accelstudy.diagnosis.space.examined import examine
from accelstudy.diagnosis.space.groups import LACK_OF_FIT, LackOfFit, all_groups, clusters
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.schemes import get_scheme

CAMPAIGNS = {
    "few, by gravity": {"scheme": "fibonacci-15", "approach": "gravity", "effects": ("settling",)},
    "no columns": {"scheme": "fibonacci-24", "interval": None, "effects": ("quadratic_scale",)},
    "all columns": {
        "scheme": "fibonacci-30", "repeat_first": 6, "temperature": (15.0, 40.0),
        "temperature_order": "random", "effects": ("thermal_bias",),
    },
}  # fmt: skip


@pytest.fixture(scope="module")
def diagnoses():
    return {
        name: diagnose(simulate_campaign(CampaignSettings(seed=2, order="random", **keys))[0], NINE)
        for name, keys in CAMPAIGNS.items()
    }


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_every_group_is_told_or_has_a_reason(diagnoses, name):
    found = diagnoses[name]
    rate = {"temperature_rate"}  # told where there are temperatures
    assert set(location.GROUPS) == set(GROUPS) - rate
    told = {*found.location, *found.not_located}
    assert told == set(GROUPS) - (rate if found.campaign.temperature is None else set())
    assert not {*found.location} & {*found.not_located}
    assert all(found.not_located.values())


def test_what_a_campaign_lacks_is_the_reason(diagnoses):
    few, none, full = (diagnoses[name] for name in CAMPAIGNS)
    for found, missing in ((few, {"temperature": "temperature", "robot_angles": "robot"}),
                           (none, {"slow_time": "time", "repeat": "twice"})):  # fmt: skip
        for group, word in missing.items():
            assert word in found.not_located[group]
    assert set(full.location) == set(GROUPS)
    assert max(full.location, key=full.location.get) == "temperature"


def test_six_redundant_conditions_locate_nothing(diagnoses):
    few = diagnoses["few, by gravity"]
    assert few.base.redundancy == 6
    assert "slow_time" in few.not_located
    assert "previous_position" in few.not_located


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_a_share_is_told_where_chance_seldom_gives_nearly_all(diagnoses, name):
    """Of residuals as large as these, in which every direction of their space is as likely."""
    found = diagnoses[name]
    examined = examine(found.frame.solution)
    residuals, rng = examined.frame.residuals, np.random.default_rng(8)
    noise = residuals.project(rng.standard_normal((len(residuals.design), 4000))).T
    r = residuals.redundancy
    excess = float(residuals.z @ residuals.z) - r
    assert excess > 0
    noise *= np.sqrt((r + excess) / np.sum(noise**2, axis=1))[:, None]
    groups = {n: g for n, g in all_groups(examined).items() if n != LACK_OF_FIT and g.dims[0]}
    seldom = location.SELDOM / (len(all_groups(examined).keys() - {LACK_OF_FIT}) + 1)
    for group, space in groups.items():
        parts = space.parts(noise)[:, 0]
        often = np.mean(parts - space.dims[0] >= location.NEARLY_ALL * excess)
        error = 4 * np.sqrt(seldom * (1 - seldom) / len(noise))
        if abs(often - seldom) > error:
            assert (group in found.location) == (often < seldom), group
        if group in found.location:
            shares = parts / (r + excess)
            usual = found.location_by_chance[group]
            assert usual == pytest.approx(shares.mean(), abs=4 * shares.std() / len(noise) ** 0.5)


@pytest.mark.parametrize("scheme", ["fibonacci-15", "fibonacci-18"])
def test_noise_alone_lives_nowhere(scheme):
    """With a redundancy of six or nine, noise is hardly said to be nearly all of one kind."""
    directions, told = shuffled(scheme), 0
    examined = design(directions, GRAVITY, some_holds(len(directions)), seed=4)
    problem = posed(GRAVITY, examined.frame.solution.observed, Level.given())
    residuals, rng = problem.residuals, np.random.default_rng(9)
    chance = Chance(np.random.SeedSequence(1), len(residuals.design), 200)
    for _ in range(100):
        errors = rng.standard_normal(len(residuals.design))
        frame = replace(problem.frame, residuals=replace(residuals, errors=errors))
        drawn = replace(problem, examined=replace(problem.examined, frame=frame))
        found = location.locate(drawn, chance, Finding("unknown", frame), 1.0)
        told += any(share > location.NEARLY_ALL for share in found.shares.values())
    assert told <= most(100, location.SELDOM, 1e-4)


def test_a_share_is_that_of_the_excess(diagnoses):
    """What a group has beyond the one that noise leaves in each of its conditions."""
    full = diagnoses["all columns"]
    examined = examine(full.base)
    residuals = examined.frame.residuals
    excess = residuals.z @ residuals.z - residuals.redundancy
    for group, space in all_groups(examined).items():
        if group in full.location:
            share = (space.parts(residuals.z)[0] - space.dims[0]) / excess
            assert full.location[group] == pytest.approx(np.clip(share, 0, 1)), group


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

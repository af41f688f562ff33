"""Where a disagreement lives: what is told, and what a campaign cannot tell."""

import numpy as np
import pytest
from diagnosis_helpers import NINE

from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.diagnosis import consequences as location
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.words import GROUPS
from accelstudy.diagnosis.space.examined import examine
from accelstudy.diagnosis.space.groups import LACK_OF_FIT, all_groups

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
    """Of white noise, in which every direction of the residual space is as likely."""
    examined = examine(diagnoses[name].frame.solution)
    residuals, rng = examined.frame.residuals, np.random.default_rng(8)
    noise = residuals.project(rng.standard_normal((len(residuals.design), 4000))).T
    total = np.sum(noise**2, axis=1)
    for group, space in all_groups(examined).items():
        if group == LACK_OF_FIT or not space.dims[0]:
            continue
        often = np.mean(space.parts(noise)[:, 0] >= location.NEARLY_ALL * total)
        error = 4 * np.sqrt(location.SELDOM * (1 - location.SELDOM) / len(noise))
        if abs(often - location.SELDOM) > error:
            assert (group in diagnoses[name].location) == (often < location.SELDOM)
        if group in diagnoses[name].location:
            share = diagnoses[name].location_by_chance[group]
            shares = space.parts(noise)[:, 0] / total
            assert share == pytest.approx(shares.mean(), abs=4 * shares.std() / len(noise) ** 0.5)


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

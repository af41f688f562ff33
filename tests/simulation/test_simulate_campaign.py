"""Simulated campaigns: the truth is told, estimated again, and drawn from separate streams."""

import numpy as np
from scipy import stats

from accelstudy import simulate_campaign as simulate
from accelstudy.campaign.format import write_campaign
from accelstudy.effects import get_effect


def values(entries):
    return {p["name"]: p["value"] for entry in entries for p in entry["parameters"]}


# --- what is simulated ---------------------------------------------------------------------------


NINE_EFFECTS = ("bias", "scale", "nonorthogonality")


def test_sizes_are_typical():
    found = np.abs([[*values(simulate(seed=s).truth["sensor"]).values()] for s in range(200)])
    for i, name in enumerate(NINE_EFFECTS):
        low, high = get_effect(name).typical
        part = found[:, 3 * i : 3 * i + 3].ravel()
        assert stats.kstest(np.log(part / low) / np.log(high / low), "uniform").pvalue > 1e-4
    truth = simulate(effects=("quadratic_scale",), size=0.5).truth
    assert {abs(v) for v in values(truth["effects"]).values()} == {2500e-6 / 2}


def test_what_is_added_changes_nothing_else_that_is_drawn():
    plain = simulate(order="random")
    more = simulate(
        order="random", effects=("thermal_bias: 0, 0, 0",), temperature=(20, 40), vibration=(0, 1),
        temperature_order="random", n_samples=9,
    )  # fmt: skip
    np.testing.assert_allclose(more.forces, plain.forces, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(more.angles, plain.angles)
    assert more.truth["sensor"] == plain.truth["sensor"]


# --- columns -------------------------------------------------------------------------------------


def test_courses_of_temperature():
    abba = simulate(temperature=(20, 40), temperature_order="ABBA")
    assert abba.temperature.tolist() == [20.0] * 6 + [40.0] * 12 + [20.0] * 6
    random = np.concatenate(
        [
            simulate(seed=s, temperature=(20, 40), temperature_order="random").temperature
            for s in range(40)
        ]
    )
    assert stats.kstest(random, stats.uniform(20, 20).cdf).pvalue > 1e-4


def test_sds_within_the_holds():
    """(n − 1) s²/σ² of the samples is χ², and s/√n estimates the sigma of the mean."""
    n, sigma = 25, 0.003
    sd = np.concatenate([simulate(seed=s, n_samples=n, sigma=sigma).sd.ravel() for s in range(20)])
    assert stats.kstest((n - 1) * sd**2 / (n * sigma**2), stats.chi2(n - 1).cdf).pvalue > 1e-4
    noisy = simulate(n_samples=n, sigma=sigma, noise_effects=("axis_noise(kappa_z=4)",))
    quiet = simulate(n_samples=n, sigma=sigma, noise_effects=("coloured_noise",))
    np.testing.assert_allclose(noisy.sd / quiet.sd, [[1, 1, 2]] * 24, rtol=1e-12)


# --- the file ------------------------------------------------------------------------------------


def test_a_campaign_does_not_tell_its_truth(tmp_path):
    effects = {"effects": ("warm_up(tau=300)",), "noise_effects": ("heavy_tails(nu=3)",)}
    write_campaign(simulate(seed=7, **effects), tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["campaign.yaml", "positions.csv"]
    text = (tmp_path / "campaign.yaml").read_text()
    assert not any(word in text for word in ("warm_up", "heavy", "seed", "truth"))

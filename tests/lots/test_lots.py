"""Lots: the mixture beside plain integrals and simulated sensors, and the command."""

import json
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pytest
from calling import refusal, succeed
from page_helpers import assert_sound, text_of
from scipy import integrate, stats

from accelstudy.campaign.format import read_campaign, write_campaign
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.diagnosis.evidence.size import Evidence, Level
from accelstudy.diagnosis.rules import RULES
from accelstudy.lots.calibrated import TypeParameter
from accelstudy.lots.evidence import (
    DRAWS,
    AnythingOdds,
    Joint,
    SensorEvidence,
    Shown,
    lot_classes,
    mean_sensor,
    together,
)
from accelstudy.lots.lot import Lot, weigh_lot
from accelstudy.lots.mixture import (
    PRIOR_ALL,
    PRIOR_EQUAL,
    PRIOR_FURTHER,
    PRIOR_MISSING,
    PRIOR_ODD,
    Anything,
    Mixture,
)
from accelstudy.lots.noise import Agreement
from accelstudy.lots.passes import LEVEL, Pass
from accelstudy.lots.run import _own_names
from accelstudy.lots.sizes import Told, TypeSizes
from accelstudy.sensors.models import get_model

STANDARD_ERRORS = 3.3
NAMES = ("thermal_bias", "quadratic_scale", "warm_up")
SPREAD = 3.0
"""Sd of what is missing, in units of the noise; a sensor shows it in one number."""


def odds_of(shown):
    """Log odds of N(0, 1 + SPREAD²) against N(0, 1)."""
    total = 1 + SPREAD**2
    return shown**2 / 2 * (1 - 1 / total) - np.log(total) / 2


def shown_by(rng, lacks):
    """Numbers, of sensors (n, K) that lack things or do not."""
    noise = rng.standard_normal(lacks.shape)
    return noise + SPREAD * lacks * rng.standard_normal(lacks.shape)


def sensor(name, odds):
    """Evidence in which each effect shows in a number of its own."""
    known = dict(zip(NAMES, odds.tolist(), strict=True))
    pairs = {(a, b): known[a] + known[b] for a, b in product(NAMES, NAMES) if a < b}
    return SensorEvidence(name, 0.5, known, pairs, tuple((n,) for n in NAMES), {}, 10,
                          np.zeros(1))  # fmt: skip


def weighed(odds, rng):
    """A pass over sensors with these odds (n, K), whose chances are those of their numbers."""
    tested = [
        AnythingOdds(NAMES, np.vstack([each, odds_of(rng.standard_normal((DRAWS, len(NAMES))))]))
        for each in odds
    ]
    anything = Anything()
    for one in tested:
        anything.add(one.names, one.odds)
    sensors = tuple(sensor(f"sensor {i}", each) for i, each in enumerate(odds))
    return Pass(sensors, anything, tested.__getitem__)


def lot_of(lacks, rng):
    return weighed(odds_of(shown_by(rng, np.asarray(lacks, dtype=float))), rng)


def test_the_evidence_of_a_set_is_its_integral():
    rng = np.random.default_rng(1)
    odds, prior = rng.normal(0, 2, (4, 2)), np.array([0.7, 0.3])
    pairs = {(0, 1): odds.sum(axis=1) - 0.5}
    mixture = Mixture.of(odds, pairs, prior)
    strange = PRIOR_ODD * (np.exp(odds) @ prior)

    def likelihood(a, b=0.0):
        sets = (1 - a) * (1 - b) + a * (1 - b) * np.exp(odds[:, 0])
        sets = sets + (1 - a) * b * np.exp(odds[:, 1]) + a * b * np.exp(pairs[0, 1])
        return np.prod((1 - PRIOR_ODD) * sets + strange)

    def over_shares(function):
        return (1 - PRIOR_ALL) * integrate.quad(function, 0, 1)[0] + PRIOR_ALL * function(1.0)

    expected = {
        (): (1 - PRIOR_MISSING) * likelihood(0.0),
        (0,): PRIOR_MISSING * (1 - PRIOR_FURTHER) * 0.7 * over_shares(likelihood),
        (0, 1): PRIOR_MISSING
        * PRIOR_FURTHER
        * over_shares(lambda a: over_shares(partial(likelihood, a))),
    }
    found = {one.names: np.exp(one.log_weight) for one in mixture.sets}
    for names, value in expected.items():
        assert found[names] == pytest.approx(value, rel=1e-6)
    # An effect may as well be equally large in all sensors; then their mean tells.
    alike = Mixture.of(odds, pairs, prior, {(0,): 3.0})
    (one,) = (one for one in alike.sets if one.names == (0,))
    value = (1 - PRIOR_EQUAL) * expected[0,] + PRIOR_EQUAL * PRIOR_MISSING * (
        1 - PRIOR_FURTHER
    ) * 0.7 * np.exp(3.0)
    assert np.exp(one.log_weight) == pytest.approx(value, rel=1e-6)
    # Each sensor lacks some set, or is odd.
    lacks, odd = mixture.sensors
    np.testing.assert_allclose(sum(lacks.values()) + odd, 1, rtol=1e-6)


def assert_so_often(said, true, parts, slack):
    """Of what is said with a probability of p, a part p is so, in each part of the scale."""
    said, true = np.array(said), np.array(true)
    for low, high in parts:
        chosen = (said >= low) & (said <= high)
        p = np.mean(said[chosen])
        apart = STANDARD_ERRORS * np.sqrt(p * (1 - p) / chosen.sum()) + slack
        assert np.mean(true[chosen]) == pytest.approx(p, abs=apart)


def test_intervals_of_the_share_hold_it():
    """Of shares that are drawn from the prior 95 % of the intervals hold them."""
    rng, n = np.random.default_rng(2), 100
    inside = []
    for _ in range(n):
        share = 1.0 if rng.random() < PRIOR_ALL else rng.random()
        odds = odds_of(shown_by(rng, np.column_stack([rng.random(20) < share, np.zeros(20)])))
        _, low, high = Mixture.of(odds, {}, np.array([0.5, 0.5])).share(0)
        inside.append(low <= share <= high)
    assert np.mean(inside) == pytest.approx(0.95, abs=STANDARD_ERRORS * np.sqrt(0.0475 / n))


def test_probabilities_of_sensors_are_right():
    rng, said, true = np.random.default_rng(3), [], []
    for _ in range(40):
        lacks = rng.random(20) < (1.0 if rng.random() < PRIOR_ALL else rng.random())
        odds = odds_of(shown_by(rng, np.column_stack([lacks, np.zeros(20)])))
        said += Mixture.of(odds, {}, np.array([0.5, 0.5])).having(0).tolist()
        true += lacks.tolist()
    assert_so_often(said, true, ((0.0, 0.2), (0.2, 0.6), (0.6, 0.9), (0.9, 1.0)), 0.03)


def shows(rng, sizes):
    """What sensors with an effect of some sizes (n, 2) show of it, in 30 numbers of noise 1."""
    derivatives = rng.standard_normal((len(sizes), 30, 2))
    z = np.einsum("nmk,nk->nm", derivatives, sizes) + rng.standard_normal((len(sizes), 30))
    normal = np.einsum("nmk,nml->nkl", derivatives, derivatives)
    return derivatives, z, normal, np.einsum("nmk,nm->nk", derivatives, z)


def told_by(rng, sizes):
    """What such sensors tell of their parameters."""
    d, z, normal, right = shows(rng, np.asarray(sizes))
    squares, square = np.sum(d**2, axis=1), np.sum(z**2, axis=1)
    return [
        Told(n, b, s, float(total), 30)
        for n, b, s, total in zip(normal, right, squares, square, strict=True)
    ]


def test_an_effect_of_one_size_is_weighed_by_all_campaigns_as_one():
    """The evidence is that of one campaign with all residuals, by least squares."""
    rng = np.random.default_rng(8)
    derivatives, z, normal, right = shows(rng, np.full((4, 2), 0.3))
    sensors = []
    for d, one, n, b in zip(derivatives, z, normal, right, strict=True):
        shown = Shown(("effect",), np.zeros((1, 0)), n[None], b[None], np.sum(d**2, axis=0)[None])
        sensors.append(SensorEvidence("c", 0.5, {}, {}, (), {}, 30, one, 30, float(one @ one),
                                      {"effect": shown}))  # fmt: skip
    joint = together(sensors)["effect"]
    d, one = derivatives.reshape(-1, 2), z.ravel()
    fitted = d @ np.linalg.lstsq(d, one, rcond=None)[0]
    evidence = Evidence(Level((1.0,), (RULES.freedom_given,), known=True), 120)
    part = evidence.of_spaces(np.array([fitted @ fitted]), [2], one @ one)[0]
    assert joint.odds == pytest.approx(part - evidence.of_noise(one @ one)[0], rel=1e-6)
    assert joint.spec == "effect"


def test_sizes_of_the_type_say_which_sensors_have_it():
    """Of what is said with a probability of p, a part p is so, and intervals hold the share."""
    rng, said, true, inside, n = np.random.default_rng(9), [], [], [], 60
    for _ in range(n):
        share = 1.0 if rng.random() < PRIOR_ALL else rng.random()
        lacks = rng.random(20) < share
        sizes = np.array([0.35, -0.25]) * (1 + 0.25 * rng.standard_normal((20, 2)))
        each = told_by(rng, sizes * lacks[:, None])
        of_type = TypeSizes.of(each, ("base_tilt",), range(20)).of_set(("base_tilt",))
        known = {(0,): of_type}
        mixture = Mixture.of(np.zeros((20, 1)), {}, np.ones(1), {(0,): 50.0}, known.get)
        said += mixture.having(0).tolist()
        true += lacks.tolist()
        _, low, high = mixture.share(0)
        inside.append(low <= share <= high)
    assert_so_often(said, true, ((0.0, 0.2), (0.8, 1.0)), 0.05)
    assert np.mean(inside) > 0.95 - STANDARD_ERRORS * np.sqrt(0.0475 / n)
    right = (np.array(said) > 0.5) == np.array(true)
    # With sizes that are known, and as many sensors with it as without: Φ(√λ/2).
    assert np.mean(right) > stats.norm.cdf(np.sqrt(30 * (0.35**2 + 0.25**2)) / 2) - 0.03


def test_nothing_missing_is_called_so_at_one_level():
    rng, n = np.random.default_rng(4), 100
    p = [lot_of(np.zeros((10, 3)), rng).p_value for _ in range(n)]
    for level in (LEVEL / 2, 0.2):
        sigma = np.sqrt(level * (1 - level) / n)
        assert np.mean(np.array(p) < level) == pytest.approx(level, abs=STANDARD_ERRORS * sigma)


def test_what_the_lot_lacks_is_named_and_what_one_sensor_lacks_makes_it_odd():
    rng = np.random.default_rng(5)
    lacks = np.zeros((20, 3))
    lacks[:12, 0] = 1
    assert [f.names for _, f in lot_of(2 * lacks, rng).found] == [("thermal_bias",)]
    odds = odds_of(shown_by(rng, np.zeros((20, 3))))
    odds[7, 1] = 25.0
    one = weighed(odds, rng)
    lot = Lot((one, one), get_model("bias-scale"), ())
    assert lot.missing
    assert one.found == []
    assert [(o.campaign, o.names) for o in lot.odd] == [("sensor 7", ("quadratic_scale",))]
    assert [names for _, names, _ in lot.each() if names] == [("odd",)]
    # Without it the others are weighed as before, with the sizes of the type, too.
    each = told_by(rng, np.full((20, 2), 0.5))
    sizes = TypeSizes.of(each, ("base_tilt",), range(20))
    together = {"warm_up": Joint(sizes.of_set(("base_tilt",)).alike, "base_tilt")}
    shapes = {frozenset({"warm_up"}): {"warm_up": "base_tilt"}}
    rest = replace(one, together=together, sizes=sizes, shapes=shapes).without_odd()
    assert len(rest.sensors) == 19
    assert rest.classes != one.classes  # their order follows the evidence
    assert rest.p_value > one.p_value
    assert rest.alternatives[0][0] == ("warm_up",)
    assert rest.mixture.share(rest.classes.index(("warm_up",)))[0] > 0.9


def test_a_sensor_is_odd_though_a_second_one_shows_the_same_by_chance():
    """Two of sixteen are too many for odd ones, and too few for a type."""
    odds = np.full((16, 3), -1.0)
    odds[9, 1], odds[4, 1] = 35.0, 2.8
    one = weighed(odds, np.random.default_rng(6))
    assert one.found == []
    assert [(o.campaign, o.names) for o in one.odd] == [("sensor 9", ("quadratic_scale",))]


def test_names_that_no_campaign_tells_apart_are_one_class():
    def shows(*classes):
        odds = {name: 1.0 - i / 10 for i, name in enumerate(sorted(n for c in classes for n in c))}
        return SensorEvidence("c", 0.5, odds, {}, classes, {}, 10, np.zeros(1))

    together = [shows(("a", "b"), ("c",))] * 2
    assert lot_classes(together) == [("a", "b"), ("c",)]
    apart = (("a",), ("b",), ("c",))
    assert lot_classes([*together, *[shows(*apart)] * 3]) == [*apart]


@pytest.mark.parametrize("freedom", [8.0, 1e6])
def test_the_noise_of_a_type_is_found_beside_an_odd_sensor(freedom):
    """Variances of 400 sensors about 0.002² with a known scatter, and some with ten times that."""
    rng = np.random.default_rng(7)
    squares = 0.002**2 * (freedom / rng.chisquare(freedom, 400)) * rng.chisquare(12, 400) / 12
    squares[:8] *= 100
    said = rng.choice([3e-4, 2e-3], 400)
    noise = Agreement.of(np.sqrt(squares) * said / 0.002, np.full(400, 12), 2 * said)
    assert noise.factor == pytest.approx(0.5, rel=0.05)
    assert noise.freedom == pytest.approx(min(freedom, 200.0), rel=0.5)


def campaigns(n, effects=(), **more):
    settings = [CampaignSettings(name=f"s{i}", seed=i, effects=effects, **more) for i in range(n)]
    return [simulate_campaign(one)[0] for one in settings]


def test_the_mean_of_sensors_has_their_noise_over_the_root_of_their_number():
    """Also with the seed zero. Of 3 times 63 degrees of freedom an sd has a sigma of 5 %."""
    made = campaigns(3)
    lot = weigh_lot(made, get_model("bias-scale-nonorthogonality"), seed=0)
    assert lot.passes[0].mean is not None
    mean, noise = mean_sensor(made, lot.sensors, [None] * 3)
    sigma = np.sqrt(np.mean([np.sum(e.residuals**2) / e.redundancy for e in lot.sensors]) / 3)
    assert noise.sigma == pytest.approx(sigma, rel=0.2)
    np.testing.assert_allclose(mean.forces, np.mean([one.forces for one in made], axis=0))
    turned = replace(made[0], forces=made[0].forces[::-1])
    untimed = replace(made[0], time=None)
    assert mean_sensor([turned, *made[1:]], lot.sensors, [None] * 3) is None
    assert mean_sensor([untimed, *made[1:]], lot.sensors, [None] * 3) is None


def test_names_of_campaigns_are_their_own():
    given = ["a", "a", "a (2)", "b"]
    assert _own_names(given, ["b"]) == ["a (1)", "a (3)", "a (2)", "b (4)"]


def over_sensors(values, sigmas, odd=()):
    """A parameter over the sensors of a lot, all of which have it."""
    usual = np.isin(np.arange(len(values)), odd, invert=True)
    return TypeParameter("b_x", "m/s^2", values, sigmas, usual, np.ones_like(usual))


def test_the_scatter_of_a_type_is_found():
    """Mean and scatter of many sensors with known ones, beside an odd one, and of a single one."""
    rng = np.random.default_rng(6)
    sigmas = rng.uniform(0.5, 1.5, 2000)
    values = 3 + rng.normal(0, 0.8, 2000) + sigmas * rng.standard_normal(2000)
    values[7] = 1e6
    many = over_sensors(values, sigmas, [7])
    low, high = many.scatter_interval()
    assert low < many.scatter < high
    assert many.mean == pytest.approx(3, abs=STANDARD_ERRORS * many.sigma)
    assert many.scatter == pytest.approx(0.8, abs=0.1)
    one = over_sensors(np.array([2.0, np.nan]), np.array([0.5, 0.5]))
    assert (one.mean, one.scatter, one.sigma) == (2.0, 0.0, 0.5)
    assert one.scatter_interval() == (0.0, np.inf)
    assert np.isnan(over_sensors(np.full(3, np.nan), np.full(3, np.nan)).mean)


def test_the_interval_of_a_scatter_holds_it():
    """Fifty sensors whose sigmas are three times their scatter, as in the tutorial."""
    rng = np.random.default_rng(8)
    n, held, true = 400, 0, 0.03
    for _ in range(n):
        sigmas = rng.uniform(0.07, 0.13, 50)
        values = 0.15 + true * rng.standard_normal(50) + sigmas * rng.standard_normal(50)
        low, high = over_sensors(values, sigmas).scatter_interval()
        held += low <= true <= high
    assert held / n == pytest.approx(0.95, abs=STANDARD_ERRORS * np.sqrt(0.95 * 0.05 / n))


N_LOT = 6


@pytest.mark.usefixtures("composed")
def test_the_command_says_what_a_lot_lacks(tmp_path):
    """Sensors with a thermal bias, one that has something else, and two that do not count."""
    for i in range(N_LOT):
        effect = "quadratic_scale" if i == N_LOT - 1 else "thermal_bias: 0.0003, -0.0003, 0.0003"
        settings = CampaignSettings(
            name=f"sensor-{i}", seed=i, effects=(effect,), temperature=(15, 35),
            temperature_order="random",
        )  # fmt: skip
        write_campaign(simulate_campaign(settings)[0], tmp_path / f"sensor-{i}")
    folders = sorted(tmp_path.glob("sensor-*"))
    few = simulate_campaign(CampaignSettings(name="few", scheme="faces-6", approach="gravity"))[0]
    copy = replace(read_campaign(folders[0]), name="copy")
    for made in (few, copy):
        write_campaign(made, tmp_path / made.name)
    listed = [*folders, tmp_path / "few", tmp_path / "copy"]
    listed = [{"campaign": str(path)} for path in listed]
    batch = tmp_path / "batch.yaml"
    batch.write_text(json.dumps({"batch": "b", "campaigns": listed}), encoding="utf-8")
    told = succeed("lot", batch, "--out", tmp_path / "lot").stdout
    content = json.loads((tmp_path / "lot/lot.json").read_text(encoding="utf-8"))
    left_out = {left["campaign"]: left["reason"] for left in content["left_out"]}
    assert left_out.keys() == {"few", "copy"}
    assert "do not determine" in left_out["few"]
    assert "has the readings of sensor-0" in left_out["copy"]
    assert content["sensors"] == N_LOT
    assert content["anything"]["missing"]
    (effect,) = content["effects"]
    assert effect["names"][0] == "thermal_bias"
    assert effect["share_ci95"][0] < 1 - 1 / N_LOT < effect["share_ci95"][1]
    assert [o["campaign"] for o in content["odd"]] == [f"sensor-{N_LOT - 1}"]
    assert [e["names"] for e in content["each"]] == [*[["thermal_bias"]] * (N_LOT - 1), ["odd"]]
    for parameter, true in zip(effect["parameters"], (3e-4, -3e-4, 3e-4), strict=True):
        assert parameter["mean"] == pytest.approx(true, abs=4 * parameter["sigma"])
    assert content["verdict"] in told
    page = (tmp_path / "lot/report.html").read_text(encoding="utf-8")
    assert_sound(page)
    assert f"A lot of {N_LOT} sensors" in text_of(page)
    assert "odd: quadratic scale" in text_of(page)
    each = sorted(path.name for path in (tmp_path / "lot/each").iterdir())
    assert each == [f"{i + 1:04d}-sensor-{i}" for i in range(N_LOT)]
    calibrated = json.loads(
        (tmp_path / "lot/each/0001-sensor-0/calibration.json").read_text(encoding="utf-8")
    )
    assert "b_T_x" in {p["name"] for p in calibrated["parameters"]}
    model = tmp_path / "lot/type.yaml"
    said = succeed("calibrate", folders[0], "--model", model, "--out", tmp_path / "c").stdout
    assert "ACCEPTED" in said
    assert "b_T_x" in said
    batch.write_text(json.dumps({"batch": "b", "campaigns": [{"log": "a.csv"}]}), encoding="utf-8")
    for given, said in (
        ([batch], "a.csv: is a log"),
        (folders[:1], "two sensors or more"),
        ([*folders[:2], folders[0]], "is given twice"),
        ([folders[0], tmp_path / "copy"], "has the readings of sensor-0; each sensor counts once"),
        ([tmp_path / "other-*"], "no folder has such a name"),
    ):
        assert said in refusal("lot", *given, "--out", tmp_path / "one")

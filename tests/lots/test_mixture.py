"""The mixture of a lot and sizes of a type, beside plain integrals and simulated sensors."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import integrate, stats

from accelstudy.diagnosis.evidence.size import SIZE_WEIGHTS, SIZES, Level, log_mean
from accelstudy.diagnosis.space.hypotheses import OUTLIER
from accelstudy.effects import get_effect
from accelstudy.lots.evidence import SensorEvidence, lot_classes
from accelstudy.lots.lot import LotDiagnosis, _settle
from accelstudy.lots.mixture import PRIOR_ALIKE, PRIOR_ALL, PRIOR_MISSING, PRIOR_ODD, Mixture
from accelstudy.lots.passes import LEVEL, MIN_CERTAIN, LotEffect, Pass
from accelstudy.lots.sizes import SCATTERS, LotResiduals, TypicalSize
from accelstudy.sensors.models import get_model

STANDARD_ERRORS = 3.3
NAMES = ("axis_nonperpendicularity", "gravity_error", "settling")
"""Effects with a parameter each, whose names alone matter here."""
SPREAD = 3.0
"""Sd of what is missing, in units of the noise; a sensor shows it in one number."""
CHANCES = 200
"""Sets of numbers without any effect, of each sensor."""
N, ROWS = 24, 30
"""Sensors of a type, and the numbers in which each shows its effects."""


def odds_of(shown):
    """Log odds of N(0, 1 + SPREAD²) against N(0, 1)."""
    total = 1 + SPREAD**2
    return shown**2 / 2 * (1 - 1 / total) - np.log(total) / 2


def shown_by(rng, lacks):
    """Numbers, of sensors (n, K) that lack things or do not."""
    lacks = np.asarray(lacks, dtype=float)
    return rng.standard_normal(lacks.shape) * np.sqrt(1 + (SPREAD * lacks) ** 2)


def mixture_of(odds, typical=()):
    """Mixture of log odds (n, K) of effects that are equally probable."""
    names = NAMES[: odds.shape[1]]
    own = dict(zip(names, odds.T, strict=True))
    return Mixture(dict.fromkeys(names, 1 / len(names)), own, dict(typical))


def weighed(odds, rng, names=NAMES):
    """A pass over sensors with these odds (n, 3), which have their p-values by simulation."""
    said = []
    for i, each in enumerate(odds):
        known = dict(zip(names, each.tolist(), strict=True))
        chance = odds_of(rng.standard_normal((CHANCES, len(names))))
        total, by_chance = log_mean(each), log_mean(chance)
        p = min((1 + np.sum(by_chance >= total)) / (1 + CHANCES), np.exp(-total))
        said.append(SensorEvidence(f"sensor {i}", p, known, [(n,) for n in names]))
    return Pass((SENSOR,) * len(said), tuple(said))


def lot_of(lacks, rng):
    return weighed(odds_of(shown_by(rng, lacks)), rng)


def type_of(rng, sizes, noise=1.0, freedom=1e9):
    """Residuals of sensors with effects of some sizes (n, 3), and with some noise."""
    d = rng.standard_normal((len(sizes), ROWS, 3))
    z = np.einsum("nmk,nk->nm", d, sizes) + noise * rng.standard_normal((len(sizes), ROWS))
    frames = [frame_of(*one) for one in zip(d, z, strict=True)]
    return d, z, LotResiduals(frames, [Level((1.0,), (freedom,), known=True)] * len(sizes))


def frame_of(d, z):
    """A campaign in whose residuals z effects show as columns d, with no parameters."""
    residuals = SimpleNamespace(
        z=z, project=lambda rows: rows, redundancy=ROWS, variance=z @ z / ROWS
    )
    return SimpleNamespace(residuals=residuals, rows=lambda e: d[:, [NAMES.index(e.name)]])


LEVEL_OF_NOISE = Level.of_stated_sigma()
SENSOR = SimpleNamespace(noise=None)
NEVER = np.full(N, -np.inf)
"""Log odds of sensors to be odd, if none is."""


def assert_so_often(said, true, parts, slack):
    """Of what is said with a probability of p, a part p is so, in each part of the scale."""
    said, true = np.array(said), np.array(true)
    for low, high in parts:
        chosen = (said >= low) & (said <= high)
        p = np.mean(said[chosen])
        apart = STANDARD_ERRORS * np.sqrt(p * (1 - p) / chosen.sum()) + slack
        assert np.mean(true[chosen]) == pytest.approx(p, abs=apart)


def test_the_evidence_of_an_effect_is_its_integral():
    rng = np.random.default_rng(1)
    odds = rng.normal(0, 2, (4, 2))
    one, other = NAMES[:2]
    own, prior = {one: odds[:, 0], other: odds[:, 1]}, {one: 0.7, other: 0.3}
    mixture = Mixture(prior, own, {})
    strange = PRIOR_ODD * (np.exp(odds) @ [0.7, 0.3])

    def over_shares(odds):
        def likelihood(share):
            each = (1 - PRIOR_ODD) * (1 - share + share * np.exp(odds)) + strange
            return np.prod(each)

        return (1 - PRIOR_ALL) * integrate.quad(likelihood, 0, 1)[0] + PRIOR_ALL * likelihood(1.0)

    nothing = (1 - PRIOR_MISSING) * np.prod(1 - PRIOR_ODD + strange)
    assert np.exp(mixture.nothing.log_weight) == pytest.approx(nothing)
    alone = over_shares(odds[:, 0])
    value = np.exp(mixture.effects[one].log_weight)
    assert value == pytest.approx(PRIOR_MISSING * 0.7 * alone, rel=1e-4)
    # A type may have sizes, with one scatter or another.
    typical = [TypicalSize(one, odds[:, 1] + i, 0.0, -0.3, np.ones(1), 0.9) for i in (0, 1)]
    alike = np.exp(-0.3) * np.mean([over_shares(size.odds) for size in typical])
    value = np.exp(Mixture(prior, own, {one: typical}).effects[one].log_weight)
    expected = (1 - PRIOR_ALIKE) * alone + PRIOR_ALIKE * alike
    assert value == pytest.approx(PRIOR_MISSING * 0.7 * expected, rel=1e-4)
    # Each sensor lacks one of them or nothing, or is odd.
    assert np.all(mixture.sensors.sum(axis=0) < 1)
    assert sum(mixture.posterior.values()) < 1


def test_shares_and_sensors_are_so_as_often_as_is_said():
    """Of lots that are drawn from the prior; of intervals of the share 95 % hold it."""
    rng, said, true, inside = np.random.default_rng(2), [], [], []
    for _ in range(150):
        missing = rng.random() < PRIOR_MISSING
        share = 1.0 if rng.random() < PRIOR_ALL else rng.random()
        lacks = rng.random((20, 1)) < share * missing
        mixture = mixture_of(odds_of(shown_by(rng, lacks)))
        said += mixture.sensors[0].tolist()
        true += lacks[:, 0].tolist()
        if missing:
            _, low, high = mixture.share(NAMES[0])
            inside.append(low <= share <= high)
    sigma = np.sqrt(0.95 * 0.05 / len(inside))
    assert np.mean(inside) == pytest.approx(0.95, abs=STANDARD_ERRORS * sigma)
    assert_so_often(said, true, ((0.0, 0.2), (0.2, 0.6), (0.6, 0.9), (0.9, 1.0)), 0.03)


@pytest.mark.parametrize("freedom", [5.0, 1e9])
def test_odds_are_the_integral_over_sizes_and_noise(freedom):
    """Of the squares of the residuals and of an effect in two thirds of the sensors."""
    sizes = 0.6 * (np.arange(N) < 2 * N / 3)[:, None] * [1.0, 0.0, 0.0]
    *_, residuals = type_of(np.random.default_rng(1), sizes, freedom=freedom)
    told = residuals.shown(NAMES[0])
    points = np.linspace(-9, 9, 301)
    shape = freedom / 2
    variance = stats.invgamma.ppf((np.arange(2000) + 0.5) / 2000, shape, scale=shape)
    typical = residuals.typical([told], NEVER)
    assert typical[1].share == pytest.approx(2 / 3, abs=0.2)
    for scatter, of_type in zip(SCATTERS, typical, strict=True):
        for i in (0, 20):
            z, normal = residuals.squares[i], told.normal[i, 0, 0]
            # Sizes scatter about the mean in units of the noise.
            spread = scatter * abs(of_type.mean[0]) * np.sqrt(variance)[:, None]
            b = of_type.mean[0] + spread * points
            squares = z - 2 * b * told.right[i, 0] + b**2 * normal
            density = stats.norm.pdf(points) * (points[1] - points[0])
            noise = variance[:, None] ** (-ROWS / 2)
            having = np.mean(np.sum(noise * np.exp(-squares / 2 / variance[:, None]) * density, 1))
            nothing = np.mean(noise * np.exp(-z / 2 / variance[:, None]))
            assert of_type.odds[i] == pytest.approx(np.log(having / nothing), abs=0.02)


def test_a_size_that_is_fitted_costs_what_its_integral_says():
    """One size in all sensors: the evidence is the mean of the likelihood over the prior of it."""
    *_, residuals = type_of(np.random.default_rng(6), np.full((N, 3), [1.0, 0.0, 0.0]))
    told = residuals.shown(NAMES[0])
    of_type = residuals.typical([told], NEVER)[SCATTERS.index(0.0)]
    normal, right = told.normal.sum(), told.right.sum()
    best, sigma = right / normal, 1 / np.sqrt(normal)
    size = best + sigma * np.linspace(-9, 9, 2001)
    likelihood = np.exp(size * right - size**2 * normal / 2)
    prior = stats.norm.pdf(size[:, None], 0, sigma * np.sqrt(SIZES)) @ SIZE_WEIGHTS
    integral = np.log(np.sum(likelihood * prior) * (size[1] - size[0]))
    assert of_type.odds.sum() + of_type.cost == pytest.approx(integral, abs=0.1)


@pytest.mark.parametrize("seed", range(5))
def test_an_effect_of_some_sensors_has_the_shape_in_which_these_have_it(seed):
    """What is plain in a quarter of them is not outweighed by chance in the others."""
    rng, sizes = np.random.default_rng(seed), np.zeros((N, 3))
    sizes[::4, 1] = 30.0
    *_, residuals = type_of(rng, sizes)
    shapes = [residuals.shown(name) for name in NAMES]
    assert {one.spec for one in residuals.typical(shapes, NEVER)} == {NAMES[1]}


def test_a_size_of_its_own_makes_a_sensor_odd_and_has_no_say_in_those_of_the_type():
    sizes = np.full((N, 3), [1.0, 0.0, 0.0])
    sizes[5] *= 40
    *_, residuals = type_of(np.random.default_rng(7), sizes)
    told = residuals.shown(NAMES[0])
    odd = told.right[:, 0] ** 2 / told.normal[:, 0, 0] / 2 - 10  # by a size of its own
    scale = told.normal[0, 0, 0] / (residuals.frames[0].rows(get_effect(NAMES[0])) ** 2).sum()
    typical = residuals.typical([told], odd)
    for of_type in typical[:2]:
        assert abs(of_type.mean[0]) * np.sqrt(scale) == pytest.approx(1.0, abs=0.2)
    apart = mixture_of(odd[:, None] + 5, {NAMES[0]: typical}).own_size(NAMES[0])
    assert np.flatnonzero(apart > 0.1).tolist() == [5]
    assert apart[5] > 0.99


@pytest.mark.parametrize("noise", [1.0, np.geomspace(0.1, 10, N)[:, None]])
def test_noise_has_as_much_in_common_as_is_said(noise):
    """Whatever the noise of each sensor, known or not."""
    rng, said = np.random.default_rng(8), []
    for _ in range(150):
        *_, residuals = type_of(rng, np.zeros((N, 3)), noise)
        told = residuals.shown(NAMES[0])
        said.append((told.p_value, *residuals.p_values_of_pattern))
    for values in np.transpose(said):
        assert stats.kstest(values, "uniform").pvalue > 1e-3


def test_what_is_too_small_for_one_sensor_shows_in_all():
    rng = np.random.default_rng(9)
    *_, residuals = type_of(rng, np.full((N, 3), [0.25, 0.0, 0.0]))
    assert residuals.shown(NAMES[0]).p_value < 1e-6
    # A pattern without a name does so where sensors were in the same positions.
    pattern = 0.5 * rng.standard_normal(ROWS)
    same = [frame_of(np.zeros((ROWS, 3)), pattern + z) for z in rng.standard_normal((N, ROWS))]
    assert LotResiduals(same, [LEVEL_OF_NOISE] * N).p_values_of_pattern[0] < 1e-6
    fewer = frame_of(np.zeros((ROWS - 1, 3)), pattern[1:])
    assert LotResiduals([*same, fewer], [LEVEL_OF_NOISE] * (N + 1)).p_values_of_pattern == []


def test_nothing_missing_is_called_so_at_one_level():
    rng, n = np.random.default_rng(4), 100
    p = [lot_of(np.zeros((10, 3)), rng).p_value for _ in range(n)]
    for level in (LEVEL / 2, 0.2):
        sigma = np.sqrt(level * (1 - level) / n)
        assert np.mean(np.array(p) < level) == pytest.approx(level, abs=STANDARD_ERRORS * sigma)


def test_a_campaign_may_be_impossible_and_all_may_be_odd():
    one = Pass((SENSOR,) * 2, (SensorEvidence("a", 0.0), SensorEvidence("b", 1.0)))
    assert one.p_value < 1e-300
    assert Pass((), ()).p_value == 1.0


def test_what_the_lot_lacks_is_named_and_what_one_sensor_lacks_makes_it_odd():
    rng = np.random.default_rng(5)
    lacks = np.zeros((20, 3))
    lacks[:12, 2] = 1
    assert lot_of(2 * lacks, rng).found.names == NAMES[2:]
    odds = odds_of(shown_by(rng, np.zeros((20, 3))))
    odds[:, 1] = -1.0
    odds[7, 1] = 25.0
    one = weighed(odds, rng)
    lot = LotDiagnosis((one, one), get_model("bias-scale"))
    assert lot.missing
    assert one.found is None
    assert [(o.campaign, o.names) for o in lot.last.odd.values()] == [("sensor 7", [NAMES[1]])]
    assert [one.names for one in lot.each if one.names] == [["odd"]]
    # The others show nothing.
    assert one.p_value_of_usual > one.p_value


def test_a_sensor_is_odd_though_a_second_one_shows_the_same_by_chance():
    """Two of sixteen are too many for odd ones, and too few for a type."""
    odds = np.full((16, 3), -1.0)
    odds[9, 1], odds[4, 1] = 35.0, 2.8
    one = weighed(odds, np.random.default_rng(6))
    assert one.found is None
    assert [(o.campaign, o.names) for o in one.odd.values()] == [("sensor 9", [NAMES[1]])]


def test_an_outlier_position_belongs_to_no_type_however_many_have_one():
    odds = np.full((12, 3), -1.0)
    odds[[2, 7, 9], 1] = 15.0
    one = weighed(odds, np.random.default_rng(8), (NAMES[0], OUTLIER, NAMES[2]))
    assert one.found is None
    assert {i: o.names for i, o in one.odd.items()} == {i: [OUTLIER] for i in (2, 7, 9)}


def test_an_odd_sensor_has_the_names_between_which_its_campaign_does_not_decide():
    odds = np.full((12, 3), -1.0)
    odds[3, :2] = 20.0, 19.5
    one = weighed(odds, np.random.default_rng(9))
    assert [(o.campaign, o.names) for o in one.odd.values()] == [("sensor 3", [*NAMES[:2]])]


def test_names_between_which_the_lot_does_not_decide_are_reported_as_one_set():
    one = weighed(np.array([[12.0, 12.1, 0.0]] * 12), np.random.default_rng(7))
    assert {*one.found.names} == {*NAMES[:2]}
    assert one.found.posterior > MIN_CERTAIN > max(one.posterior.values())


def test_what_imitates_two_effects_gives_way_beside_one_of_them():
    imitator, second, first = (
        LotEffect((name,), 1.0, 1.0, (0.9, 1.0), name, (), *np.eye(2)) for name in NAMES
    )
    found = {(): imitator, imitator.names: second, second.names: first, first.names: second}

    def beside(effects):
        return SimpleNamespace(found=found[sum((one.names for one in effects), ())])

    assert _settle([imitator], beside) == [imitator]
    assert _settle([imitator, second], beside) == [first, second]
    assert _settle([first, second], beside) == [first, second]


def test_names_that_no_campaign_tells_apart_are_one_class():
    def shows(*classes):
        odds = {name: 1.0 - i / 10 for i, name in enumerate(sorted(n for c in classes for n in c))}
        return SensorEvidence("c", odds=odds, classes=classes)

    alike = [shows(("a", "b"), ("c",))] * 2
    assert lot_classes(alike) == {"a": ("a", "b"), "c": ("c",)}
    assert [*lot_classes([*alike, *[shows(("a",), ("b",), ("c",))] * 3])] == ["a", "b", "c"]

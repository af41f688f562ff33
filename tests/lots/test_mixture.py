"""The mixture of a lot and sizes of a type, beside plain integrals and simulated sensors."""

from dataclasses import replace
from functools import partial
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import integrate, stats

from accelstudy.diagnosis.evidence.size import SIZE_WEIGHTS, SIZES, log_mean
from accelstudy.lots.evidence import SensorEvidence, lot_classes
from accelstudy.lots.lot import LotDiagnosis
from accelstudy.lots.mixture import (
    PRIOR_ALIKE,
    PRIOR_ALL,
    PRIOR_FURTHER,
    PRIOR_MISSING,
    PRIOR_ODD,
    Mixture,
)
from accelstudy.lots.passes import LEVEL, MIN_CERTAIN, Pass
from accelstudy.lots.sizes import SCATTERS, TypeSizes, most_likely, subsets_of
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


def mixture_of(odds, **known):
    """Mixture of log odds (n, K) of effects that are equally probable."""
    names = NAMES[: odds.shape[1]]
    prior = dict.fromkeys(names, 1 / len(names))
    return Mixture(dict(zip(names, odds.T, strict=True)), {}, prior, **known)


def weighed(odds, rng):
    """A pass over sensors with these odds (n, 3), which have their p-values by simulation."""
    said = []
    for i, each in enumerate(odds):
        known = dict(zip(NAMES, each.tolist(), strict=True))
        pairs = {(a, b): known[a] + known[b] for a, b in combinations(NAMES, 2)}
        chance = odds_of(rng.standard_normal((CHANCES, len(NAMES))))
        total, by_chance = log_mean(each), log_mean(chance)
        p = min((1 + np.sum(by_chance >= total)) / (1 + CHANCES), np.exp(-total))
        said.append(SensorEvidence(f"sensor {i}", p, known, pairs, [(n,) for n in NAMES]))
    return Pass((None,) * len(said), tuple(said))


def lot_of(lacks, rng):
    return weighed(odds_of(shown_by(rng, lacks)), rng)


def type_of(rng, sizes, like=0.0, first=0.0):
    """What sensors with effects of some sizes (n, 3) tell; each is like the one before it."""
    d = rng.standard_normal((len(sizes), ROWS, 3))
    d[..., 1] = first * d[..., 0] + np.sqrt(1 - first**2) * d[..., 1]
    d[..., 2] = like * d[..., 1] + np.sqrt(1 - like**2) * d[..., 2]
    z = np.einsum("nmk,nk->nm", d, sizes) + rng.standard_normal((len(sizes), ROWS))
    frames = [frame_of(*one) for one in zip(d, z, strict=True)]
    return d, z, TypeSizes.of(frames, {name: [name] for name in NAMES}, np.full(len(sizes), True))


def frame_of(d, z):
    """A campaign in whose residuals z effects show as columns d, with no parameters."""
    residuals = SimpleNamespace(z=z, project=lambda rows: rows, redundancy=ROWS)
    return SimpleNamespace(residuals=residuals, rows=lambda e: d[:, [NAMES.index(e.name)]])


def two_effects(rng, like=0.0, first=0.0):
    """All sensors have the first effect, a third of them the second one, none the third."""
    lacks = np.zeros((N, 3))
    lacks[:, 0], lacks[: N // 3, 1] = 1, 1
    return lacks, *type_of(rng, 0.6 * lacks, like, first)


def assert_so_often(said, true, parts, slack):
    """Of what is said with a probability of p, a part p is so, in each part of the scale."""
    said, true = np.array(said), np.array(true)
    for low, high in parts:
        chosen = (said >= low) & (said <= high)
        p = np.mean(said[chosen])
        apart = STANDARD_ERRORS * np.sqrt(p * (1 - p) / chosen.sum()) + slack
        assert np.mean(true[chosen]) == pytest.approx(p, abs=apart)


def test_the_evidence_of_a_set_is_its_integral():
    rng = np.random.default_rng(1)
    odds = rng.normal(0, 2, (4, 2))
    pair = odds.sum(axis=1) - 0.5
    one, other = NAMES[:2]
    mixture = replace(mixture_of(odds), prior={one: 0.7, other: 0.3}, pairs={(one, other): pair})
    strange = PRIOR_ODD * (np.exp(odds) @ [0.7, 0.3])

    def likelihood(a, b=0.0):
        sets = (1 - a) * (1 - b) + a * (1 - b) * np.exp(odds[:, 0])
        sets = sets + (1 - a) * b * np.exp(odds[:, 1]) + a * b * np.exp(pair)
        return np.prod((1 - PRIOR_ODD) * sets + strange)

    def over_shares(function):
        return (1 - PRIOR_ALL) * integrate.quad(function, 0, 1)[0] + PRIOR_ALL * function(1.0)

    alone = PRIOR_MISSING * (1 - PRIOR_FURTHER) * 0.7
    both = PRIOR_MISSING * PRIOR_FURTHER
    expected = {
        (): (1 - PRIOR_MISSING) * likelihood(0.0),
        (one,): alone * over_shares(likelihood),
        (one, other): both * over_shares(lambda a: over_shares(partial(likelihood, a))),
    }
    for names, value in expected.items():
        assert np.exp(mixture.sets[names].log_weight) == pytest.approx(value, rel=1e-6)
    # What has no name may as well be the same in all sensors.
    alike = replace(mixture, common={one: 3.0}).sets[one,].log_weight
    value = (1 - PRIOR_ALIKE) * expected[one,] + PRIOR_ALIKE * alone * np.exp(3.0)
    assert np.exp(alike) == pytest.approx(value, rel=1e-6)
    # Each sensor lacks some set, or is odd.
    lacks, odd = mixture.sensors
    np.testing.assert_allclose(sum(lacks.values()) + odd, 1, rtol=1e-6)


def test_shares_and_sensors_are_so_as_often_as_is_said():
    """Of lots that are drawn from the prior; of intervals of the share 95 % hold it."""
    rng, said, true, inside = np.random.default_rng(2), [], [], []
    one = PRIOR_MISSING * (1 - PRIOR_FURTHER)
    for _ in range(150):
        missing = rng.random() < one / (one + 1 - PRIOR_MISSING)
        share = 1.0 if rng.random() < PRIOR_ALL else rng.random()
        lacks = rng.random((20, 1)) < share * missing
        mixture = mixture_of(odds_of(shown_by(rng, lacks)))
        said += mixture.having(NAMES[0]).tolist()
        true += lacks[:, 0].tolist()
        if missing:
            _, low, high = mixture.share(NAMES[0])
            inside.append(low <= share <= high)
    sigma = np.sqrt(0.95 * 0.05 / len(inside))
    assert np.mean(inside) == pytest.approx(0.95, abs=STANDARD_ERRORS * sigma)
    assert_so_often(said, true, ((0.0, 0.2), (0.2, 0.6), (0.6, 0.9), (0.9, 1.0)), 0.03)


def test_odds_are_the_integral_over_the_sizes_of_the_type():
    _, _, _, sizes = two_effects(np.random.default_rng(1))
    both = NAMES[:2]
    best = most_likely(sizes.of_set(both))
    assert best.shares[NAMES[0]] > 0.9
    assert best.shares[NAMES[1]] == pytest.approx(1 / 3, abs=0.15)

    def integral(of_type, i, names, scatter):
        """Log of the mean of exp(ℓ) over normal sizes, by quadrature."""
        at = [NAMES.index(name) for name in names]
        normal, right = sizes.normal[i][np.ix_(at, at)], sizes.right[i][at]
        mean = of_type.mean[at]
        # The trapezoidal rule is exact to rounding for what has ended at the limits.
        steps = np.linspace(-9, 9, 301)
        grid = np.stack(np.meshgrid(*[steps] * len(at), indexing="ij"), axis=-1)
        grid = grid.reshape(-1, len(at))
        b = mean + scatter * abs(mean) * grid
        density = np.prod(stats.norm.pdf(grid), axis=1) * (steps[1] - steps[0]) ** len(at)
        quadratic = np.einsum("nk,kl,nl->n", b, normal, b)
        return np.log(np.sum(density * np.exp(b @ right - quadratic / 2)))

    for scatter, of_type in zip(SCATTERS, sizes.of_set(both), strict=True):
        for i, names in ((0, both[:1]), (20, both[1:]), (3, both)):
            expected = integral(of_type, i, names, scatter)
            odds = of_type.odds[subsets_of(both).index(names), i]
            assert odds == pytest.approx(expected, rel=1e-3, abs=1e-3)


def test_a_size_that_is_fitted_costs_what_its_integral_says():
    """One size in all sensors: the evidence is the mean of the likelihood over the prior of it."""
    *_, sizes = type_of(np.random.default_rng(6), np.full((N, 3), [1.0, 0.0, 0.0]))
    alone = NAMES[:1]
    of_type = sizes.of_set(alone)[SCATTERS.index(0.0)]
    normal, right = sizes.normal[:, 0, 0].sum(), sizes.right[:, 0].sum()
    best, sigma = right / normal, 1 / np.sqrt(normal)
    size = best + sigma * np.linspace(-9, 9, 2001)
    likelihood = np.exp(size * right - size**2 * normal / 2)
    prior = stats.norm.pdf(size[:, None], 0, sigma * np.sqrt(SIZES)) @ SIZE_WEIGHTS
    integral = np.log(np.sum(likelihood * prior) * (size[1] - size[0]))
    assert of_type.odds[-1].sum() + of_type.cost == pytest.approx(integral, abs=0.1)


def test_the_noise_is_that_which_the_best_effects_leave():
    """In units of it, what a sensor tells of an effect that it lacks scatters as noise does."""
    true = np.zeros((400, 3))
    true[:, 0], true[:200, 1] = 3.0, -2.0
    *_, sizes = type_of(np.random.default_rng(4), true)
    told = []
    for normal, right in zip(sizes.normal, sizes.right, strict=True):
        by = np.linalg.solve(normal[:2, :2], normal[:2, 2])
        told.append((right[2] - by @ right[:2]) / np.sqrt(normal[2, 2] - by @ normal[:2, 2]))
    assert np.std(told) == pytest.approx(1, abs=STANDARD_ERRORS / np.sqrt(800))


def test_nothing_missing_is_called_so_at_one_level():
    rng, n = np.random.default_rng(4), 100
    p = [lot_of(np.zeros((10, 3)), rng).p_value for _ in range(n)]
    for level in (LEVEL / 2, 0.2):
        sigma = np.sqrt(level * (1 - level) / n)
        assert np.mean(np.array(p) < level) == pytest.approx(level, abs=STANDARD_ERRORS * sigma)


def test_a_campaign_may_be_impossible_and_all_may_be_odd():
    one = Pass((None,) * 2, (SensorEvidence("a", 0.0), SensorEvidence("b", 1.0)))
    assert one.p_value < 1e-300
    assert Pass((), ()).p_value == 1.0


def test_what_the_lot_lacks_is_named_and_what_one_sensor_lacks_makes_it_odd():
    rng = np.random.default_rng(5)
    lacks = np.zeros((20, 3))
    lacks[:12, 2] = 1
    assert [found.names for found in lot_of(2 * lacks, rng).found] == [NAMES[2:]]
    odds = odds_of(shown_by(rng, np.zeros((20, 3))))
    odds[:, 1] = -1.0
    odds[7, 1] = 25.0
    one = weighed(odds, rng)
    lot = LotDiagnosis((one, one), get_model("bias-scale"))
    assert lot.missing
    assert one.found == []
    assert [(o.campaign, o.names) for o in lot.last.odd] == [("sensor 7", (NAMES[1],))]
    assert [one.names for one in lot.each if one.names] == [("odd",)]
    # The others show nothing.
    assert one.p_value_of_usual > one.p_value


def test_a_sensor_is_odd_though_a_second_one_shows_the_same_by_chance():
    """Two of sixteen are too many for odd ones, and too few for a type."""
    odds = np.full((16, 3), -1.0)
    odds[9, 1], odds[4, 1] = 35.0, 2.8
    one = weighed(odds, np.random.default_rng(6))
    assert one.found == []
    assert [(o.campaign, o.names) for o in one.odd] == [("sensor 9", (NAMES[1],))]


def test_names_that_exclude_each_other_are_reported_as_one_set():
    """Each sensor has one of two effects that it cannot tell apart, and the third by itself."""
    odds = np.array([[12.0, 12.0, 12.0]] * 12)
    both = [{**{pair: 12.0 for pair in combinations(NAMES, 2)}, NAMES[1:]: 24.0, NAMES[::2]: 24.0}]
    one = weighed(odds, np.random.default_rng(7))
    said = [replace(each, pairs=both[0]) for each in one.evidence]
    found = replace(one, evidence=tuple(said)).found
    assert [{*effect.names} for effect in found] == [{NAMES[2]}, {*NAMES[:2]}]


def test_names_that_may_be_missing_together_are_reported_apart():
    """Each sensor shows either of two effects, and both together a little better."""
    both = {NAMES[:2]: 12.3, NAMES[1:]: 12.0, NAMES[::2]: 12.0}
    one = weighed(np.array([[12.0, 12.0, 0.0]] * 12), np.random.default_rng(7))
    one = replace(one, evidence=tuple(replace(each, pairs=both) for each in one.evidence))
    assert max(one.given.values()) < MIN_CERTAIN  # while one of the two is sure to be missing
    assert one.mixture.of_any(NAMES[:2]) > MIN_CERTAIN * one.wrong
    assert [effect.names for effect in one.found] == [(NAMES[0],), (NAMES[1],)]


def test_names_that_no_campaign_tells_apart_are_one_class():
    def shows(*classes):
        odds = {name: 1.0 - i / 10 for i, name in enumerate(sorted(n for c in classes for n in c))}
        return SensorEvidence("c", odds=odds, classes=classes)

    alike = [shows(("a", "b"), ("c",))] * 2
    assert lot_classes(alike) == {"a": ("a", "b"), "c": ("c",)}
    assert [*lot_classes([*alike, *[shows(("a",), ("b",), ("c",))] * 3])] == ["a", "b", "c"]

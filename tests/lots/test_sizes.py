"""Sizes of effects as those of a type, beside plain integrals and least squares."""

import numpy as np
import pytest
from scipy import stats

from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.lots.evidence import sensor_evidence
from accelstudy.lots.mixture import Mixture
from accelstudy.lots.sizes import SCATTERS, Told, TypeSizes, told

SPECS = ("settling", "gravity_error", "axis_nonperpendicularity")
"""Effects with a parameter each, whose names alone matter here."""
N, ROWS = 24, 30


def sensors(rng, sizes, like=0.0, first=0.0):
    """What sensors with effects of some sizes (n, 3) tell; each is like the one before it."""
    d = rng.standard_normal((len(sizes), ROWS, 3))
    d[..., 1] = first * d[..., 0] + np.sqrt(1 - first**2) * d[..., 1]
    d[..., 2] = like * d[..., 1] + np.sqrt(1 - like**2) * d[..., 2]
    z = np.einsum("nmk,nk->nm", d, sizes) + rng.standard_normal((len(sizes), ROWS))
    each = [
        Told(a.T @ a, a.T @ b, np.sum(a**2, axis=0), float(b @ b), ROWS)
        for a, b in zip(d, z, strict=True)
    ]
    return d, TypeSizes.of(each, SPECS, range(len(each)))


def lot(rng, size=0.6, like=0.0, first=0.0):
    """All sensors have the first effect, a third of them the second one, none the third."""
    lacks = np.zeros((N, 3))
    lacks[:, 0], lacks[: N // 3, 1] = 1, 1
    return lacks, *sensors(rng, size * lacks, like, first)


def test_odds_are_the_integral_over_the_sizes_of_the_type():
    _, _, sizes = lot(np.random.default_rng(1))
    of_type = sizes.of_set(SPECS[:2])
    assert of_type.shares[0] > 0.9
    assert of_type.shares[1] == pytest.approx(1 / 3, abs=0.15)

    def integral(i, at, scatter):
        """Log of the mean of exp(ℓ) over normal sizes, by quadrature."""
        normal, right = sizes.normal[i][np.ix_(at, at)], sizes.right[i][at]
        mean = of_type.mean[at]

        # The trapezoidal rule is exact to rounding for what has ended at the limits.
        steps = np.linspace(-9, 9, 301)
        grid = np.stack(np.meshgrid(*[steps] * len(at), indexing="ij"), axis=-1).reshape(
            -1, len(at)
        )
        b = mean + scatter * abs(mean) * grid
        density = np.prod(stats.norm.pdf(grid), axis=1) * (steps[1] - steps[0]) ** len(at)
        quadratic = np.einsum("nk,kl,nl->n", b, normal, b)
        return np.log(np.sum(density * np.exp(b @ right - quadratic / 2)))

    for i, at in ((0, [0]), (20, [1]), (3, [0, 1])):
        near = [integral(i, at, scatter) - of_type.odds[tuple(at)][i] for scatter in SCATTERS]
        assert min(map(abs, near)) < 1e-3 * max(1, abs(of_type.odds[tuple(at)][i]))


def test_what_a_third_has_is_found_beside_what_all_have():
    """Of ten lots; by itself a sensor shows it with a noncentrality of 11."""
    rng, named, right = np.random.default_rng(2), 0, []
    for _ in range(10):
        lacks, _, sizes = lot(rng, like=0.7)
        known = {
            names: sizes.of_set([SPECS[k] for k in names])
            for names in [(0,), (1,), (2,), (0, 1), (0, 2), (1, 2)]
        }
        common = {(k,): known[k,].alike - 3 for k in range(3)}
        mixture = Mixture.of(np.zeros((N, 3)), {}, np.ones(3) / 3, common, known.get)
        named += mixture.sets[0].names == (0, 1)
        right.append(np.mean((mixture.having(1) > 0.5) == lacks[:, 1]))
    assert named >= 9
    # With a known size the error is Φ(−√λ/2) where half of the sensors have it, and less here.
    assert np.mean(right) > stats.norm.cdf(np.sqrt(ROWS) * 0.6 / 2) - 0.03


@pytest.mark.parametrize("like", [0.3, 0.99])
def test_what_an_effect_leaves_beside_a_rival_is_that_of_least_squares(like):
    _, d, sizes = lot(np.random.default_rng(3), like=like, first=0.8)
    of_type = sizes.of_set(SPECS[:2])
    columns = d.reshape(-1, 3)
    own, expected = 0.6 * columns[:, 1], []
    for beside in ([0, 2], [0]):
        others = columns[:, beside]
        left = own - others @ np.linalg.lstsq(others, own, rcond=None)[0]
        expected.append(left @ left / 3)
    found = sizes.apart(SPECS[:2], of_type, 1, SPECS[2])
    assert found == pytest.approx(expected, rel=0.4)
    assert found[0] / found[1] == pytest.approx(expected[0] / expected[1], rel=0.02)


def test_the_noise_is_that_which_the_best_effects_leave():
    """In units of it, what a sensor tells of an effect that it lacks scatters as noise does."""
    rng = np.random.default_rng(4)
    sizes = np.zeros((400, 3))
    sizes[:, 0], sizes[:200, 1] = 3.0, -2.0
    _, of_lot = sensors(rng, sizes)
    told = []
    for normal, right in zip(of_lot.normal, of_lot.right, strict=True):
        by = np.linalg.solve(normal[:2, :2], normal[:2, 2])
        told.append((right[2] - by @ right[:2]) / np.sqrt(normal[2, 2] - by @ normal[:2, 2]))
    assert np.std(told) == pytest.approx(1, abs=3.3 / np.sqrt(800))


def test_a_campaign_that_does_not_determine_the_model_says_nothing():
    campaign, _ = simulate_campaign(CampaignSettings(name="few", scheme="faces-6"))
    silent, of_test = sensor_evidence(campaign, None)
    assert silent.odds == {}
    assert of_test.names == ()
    none = told(campaign, None, None, None, ("thermal_bias",))
    assert none.normal.shape == (3, 3)
    assert not none.normal.any()

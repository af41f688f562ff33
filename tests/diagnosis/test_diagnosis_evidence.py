"""The evidence of hypotheses: densities, the test that is read off them, and the posterior."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_helpers import design, explanation, posed, shuffled
from scipy import stats
from usual import GRAVITY, NINE, ROBOT, G

from accelstudy.diagnosis.decision.posterior import Explanation, Posterior
from accelstudy.diagnosis.evidence.candidates import Cause, Field
from accelstudy.diagnosis.evidence.detection import draw_effects, log_ratio
from accelstudy.diagnosis.evidence.noise import NOISES, most_evidence, unequal_axes_density
from accelstudy.diagnosis.evidence.size import (
    SHAPE_SIZES,
    SHAPE_WEIGHTS,
    SIZE_WEIGHTS,
    SIZES,
    Evidence,
    Level,
)
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise, session

R = 40
LEVELS = {"given": Level.of_stated_sigma(), "not given": Level((1.0,), (0.5,), known=False)}


def exact(level, z, kernel, sizes=SIZES, weights=SIZE_WEIGHTS):
    """Log density of z (..., R) by multivariate t distributions, less that of noise alone."""

    def mixed(sizes, weights):
        logs = [
            stats.multivariate_t.logpdf(z, shape=np.eye(R) + size * kernel, df=nu)
            + np.log(weight * p)
            for size, weight in zip(sizes, weights, strict=True)
            for p, nu in zip(level.weights, level.freedoms, strict=True)
        ]
        return np.logaddexp.reduce(logs)

    return mixed(sizes, weights) - mixed([0.0], [1.0])


def against_noise(evidence, logs, z):
    """Log densities less that of noise alone."""
    nothing = np.logaddexp.reduce(evidence.noise_density(np.sum(z**2, axis=-1)), axis=-1)
    return logs - nothing[..., None]


@pytest.mark.parametrize("known", LEVELS)
def test_densities_are_mixtures_of_t_distributions(known):
    """Of spaces, of which nothing else is known; the integral over sizes is a table."""
    rng = np.random.default_rng(1)
    bases = [np.linalg.qr(rng.standard_normal((R, d)))[0] for d in (1, 3, 6)]
    z = np.array([[0.5], [1.0], [2.0]]) * rng.standard_normal((3, R)) + 6 * bases[1][:, 1]
    evidence = Evidence(LEVELS[known], R)
    parts = np.stack([np.sum((z @ b) ** 2, axis=1) for b in bases], axis=1)
    found = evidence.spaces_density(parts, [1, 3, 6], np.sum(z**2, axis=1))
    expected = [exact(LEVELS[known], z, b @ b.T / b.shape[1]) for b in bases]
    assert pytest.approx(np.array(expected), abs=0.01) == against_noise(evidence, found, z).T


@pytest.mark.parametrize("known", LEVELS)
def test_densities_are_those_of_gaussian_processes(known):
    """Of shapes with covariances of their own; of many residuals at once to seven digits."""
    rng = np.random.default_rng(1)
    bases = [np.linalg.qr(rng.standard_normal((R, k)))[0] for k in (2, 5)]
    shares = [np.array([0.3, 0.7]), np.array([0.02, 0.05, 0.13, 0.3, 0.5])]
    z = np.array([[0.5], [1.0], [2.0]]) * rng.standard_normal((3, R)) + 5 * bases[1][:, -1]
    level, prior = LEVELS[known], (SHAPE_SIZES, SHAPE_WEIGHTS)
    pairs = zip(bases, shares, strict=True)
    expected = np.array([exact(level, z, (b * share) @ b.T, *prior) for b, share in pairs]).T
    evidence, along = Evidence(level, R), [(z @ basis) ** 2 for basis in bases]
    for some, digits in ((slice(None), 1e-3), (slice(1), 1e-9)):
        squares = np.sum(z[some] ** 2, axis=1)
        found = evidence.shapes_density([a[some] for a in along], shares, squares)
        assert against_noise(evidence, found, z[some]) == pytest.approx(expected[some], abs=digits)


@pytest.fixture(scope="module", params=[ROBOT, GRAVITY], ids=lambda approach: approach.name)
def frame(request):
    return design(shuffled("fibonacci-30"), request.param, seed=7)


def test_noise_is_not_noise_with_an_effect(frame):
    """What is drawn with an effect is found, and its weight takes it out again."""
    residuals, rng = frame.residuals, np.random.default_rng(3)
    shapes = Field(frame.candidates).spaces
    changed = draw_effects(shapes, 400, rng)
    noise = rng.standard_normal(changed.shape) + residuals.project(changed.T).T
    z = residuals.project(noise.T).T
    weights = np.exp(-log_ratio(shapes, z))
    squares = np.sum(z**2, axis=1)
    r = residuals.redundancy
    assert np.mean(squares) > r + 10
    assert np.sum(weights * squares) / np.sum(weights) == pytest.approx(r, rel=0.25)


@pytest.mark.parametrize("approach", [ROBOT, GRAVITY], ids=lambda approach: approach.name)
def test_axes_differ_as_far_as_the_data_say(approach):
    """Equal axes are seldom taken for unequal ones, clearly unequal ones always are."""
    odds = {}
    for effect in (None, "axis_noise(kappa_z=9)"):
        effects = () if effect is None else (effect,)
        odds[effect] = []
        for seed in range(8):
            noise = Noise(sigma_angle=1e-6, effects=effects)
            residuals = design(shuffled("fibonacci-60"), approach, noise=noise, seed=seed)
            residuals = residuals.residuals
            evidence = Evidence(Level.of_nothing_stated(), residuals.redundancy)
            nothing = np.logaddexp.reduce(evidence.noise_density(residuals.z @ residuals.z))
            axes = unequal_axes_density(residuals, evidence, None)
            odds[effect].append(axes - nothing)
    assert np.median(odds[None]) < 0
    assert np.median(odds["axis_noise(kappa_z=9)"]) > np.log(5)


def test_what_the_holds_show_of_the_axes_counts_where_residuals_say_little():
    """The noise within the holds, if it is that of the residuals, makes them more probable."""
    noise = Noise(sigma_angle=1e-6, effects=("axis_noise(kappa_z=9)",))
    residuals = design(shuffled("mclaren-24"), ROBOT, noise=noise, seed=3).residuals
    evidence = Evidence(Level.of_nothing_stated(), residuals.redundancy)
    alone, right, wrong = (
        unequal_axes_density(residuals, evidence, within)
        for within in (None, np.array([1.0, 1.0, 9.0]), np.array([9.0, 9.0, 1.0]))
    )
    assert right > max(alone, wrong)


def test_a_p_value_means_no_more_than_it_can():
    assert most_evidence(0.05) == pytest.approx(np.log(2.456), abs=1e-3)
    assert most_evidence(0.5) == 0.0


def test_the_posterior_merges_what_means_the_same():
    given = {"a=z": 0.3, "b+c": 0.1, "c+b": 0.1, "b": 0.2}
    weighed = [explanation(text, np.log(p)) for text, p in given.items()]
    same = Cause("z", weighed[0].classes[0])
    posterior = Posterior.of([*weighed, Explanation((same,), np.log(0.3))])
    assert tuple(one.posterior for one in posterior.all) == pytest.approx((0.6, 0.2, 0.2))
    assert posterior.reported[0].names == ("a",)
    assert sum(one.posterior for one in posterior.credible_set) == pytest.approx(1.0)


def weighed(*names_and_probabilities):
    """Explanations with a shape for each effect, as a search would give them."""
    return [
        explanation(
            "+".join(names), np.log(p), best=[object()] * len(names) * (names[0] not in NOISES)
        )
        for names, p in names_and_probabilities
    ]


DRIFT, OTHER, BIAS = ("bias_drift",), ("hysteresis",), ("bias",)


@pytest.mark.parametrize(("given", "told"), [
    # Where one effect is more probable a pair counts for its better half.
    ({DRIFT: 0.5, OTHER: 0.2, DRIFT + OTHER: 0.1, OTHER + BIAS: 0.2}, {DRIFT: 0.6, OTHER: 0.4}),
    # A pair that is more probable than its parts stands.
    ({DRIFT + OTHER: 0.3, DRIFT: 0.25, BIAS: 0.45}, {BIAS: 0.45, DRIFT + OTHER: 0.3, DRIFT: 0.25}),
    # Where two effects are more probable, all pairs stand.
    ({BIAS + DRIFT: 0.3, BIAS + OTHER: 0.2, (*BIAS, "warm_up"): 0.1, BIAS: 0.4},
     {BIAS: 0.4, BIAS + DRIFT: 0.3, BIAS + OTHER: 0.2, (*BIAS, "warm_up"): 0.1}),
])  # fmt: skip
def test_what_is_told_of_pairs(given, told):
    posterior = Posterior.of(weighed(*given.items()))
    assert {e.names: e.posterior for e in posterior.reported} == pytest.approx(told)
    assert [e.names for e in posterior.reported] == [*told]
    assert [e.posterior for e in posterior.all] == pytest.approx(sorted(given.values())[::-1])


def test_wrong_noise_of_all_kinds_is_one_explanation():
    posterior = Posterior.of(
        weighed((("bias",), 0.4), (("axis_noise",), 0.2), (("heavy_tails",), 0.4 - 1e-9))
    )
    assert posterior.reported[0].names == ("heavy_tails",)
    assert posterior.p_noise == pytest.approx(0.6)


def test_a_credible_set_is_the_smallest():
    p = [0.05, 0.5, 0.1, 0.35]
    found = Posterior.of([explanation(str(x), np.log(x)) for x in p]).credible_set
    assert [one.posterior for one in found] == pytest.approx([0.5, 0.35, 0.1])


@pytest.mark.parametrize(("level", "spread", "of_repeats"), [
    (Level.of_nothing_stated(), 0.02, True),
    (Level.of_stated_sigma(), 0.02, False),
    (Level.of_nothing_stated(), 0.0, None),
    (Level.of_stated_sigma(), 0.0, None),
])  # fmt: skip
def test_a_fit_that_misses_more_than_the_noise_is_no_explanation(level, spread, of_repeats):
    rng = np.random.default_rng(8)
    attitudes = get_scheme("fibonacci-24").directions
    ideal = session(NINE, np.zeros(9), np.tile(attitudes, (2, 1)), G)
    observed = ideal.draw(Noise(), 1, rng)
    # Each attitude misses by an amount of its own, which its repeat has, too.
    missed = np.tile(spread * rng.standard_normal((24, 3)), (2, 1))
    observed = replace(observed, forces=observed.forces + missed)
    problem = posed(GRAVITY, observed, level)
    found = problem.misfit(problem.base.solution)
    assert (found and found.of_repeats) == of_repeats

"""The tests of the noise: they err as often as they say, and each finds what it is about."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_helpers import least, most
from quality_helpers import SIGMA, draw, solutions
from scipy import stats
from usual import BOTH, GRAVITY, ROBOT, G

from accelstudy.diagnosis.evidence.detection import Chance
from accelstudy.diagnosis.evidence.noise import (
    axis_test,
    colour_test,
    coloured_density,
    resolution_test,
    tail_test,
    unequal_axes_density,
    within_hold_test,
)
from accelstudy.diagnosis.evidence.size import Evidence, Level
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.simulation.sessions import Noise

RUNS, SIMULATED = 200, 200
RARE = 1e-4
"""Probability with which a test of p-values fails by chance."""


def sessions(approach, *effects, seed, scheme="mclaren-24", runs=RUNS, **noise):
    """Residuals of calibrated sessions, and their forces."""
    drawn = draw(seed, scheme, noise=Noise(effects=effects, **noise), replicates=runs)
    return [Residuals.of(s) for s in solutions(approach, drawn)], drawn


@pytest.fixture(scope="module")
def white():
    return {a.name: sessions(a, seed=1)[0] for a in (GRAVITY, ROBOT)}


def chance(residuals, seed):
    """Simulated residuals of a fit."""
    return Chance(np.random.SeedSequence(seed), len(residuals.design), SIMULATED)


def independent(errors):
    """Residuals of as many redundant conditions, of a model that absorbs two others."""
    r = len(errors)
    design = np.concatenate([np.zeros((r, 2)), np.eye(2)])
    eye = np.ones((r + 2, 1, 1))
    return Residuals(design, np.append(errors, [5.0, -3.0]), eye, eye, np.ones((r + 2, 1)))


def assert_uniform(p):
    """KS, which steps of 1/201 change little; and rejections at the usual levels."""
    assert stats.kstest(p, "uniform").pvalue > RARE
    for level in (0.01, 0.05, 0.10):
        # A simulated p-value of at most `level` has the probability ⌊201 level⌋ / 201.
        exact = np.floor((SIMULATED + 1) * level) / (SIMULATED + 1)
        assert least(len(p), exact, RARE) <= np.sum(p <= level) <= most(len(p), level, RARE)


# --- nothing is wrong ----------------------------------------------------------------------------


def evidence_of(residuals):
    """Log evidence for unequal axes and for coloured noise, where sigma is not given."""
    evidence = Evidence(Level.of_nothing_stated(), residuals.redundancy)
    nothing = np.logaddexp.reduce(evidence.noise_density(residuals.z @ residuals.z))
    colour = coloured_density(residuals, evidence)
    return unequal_axes_density(residuals, evidence, None) - nothing, colour - nothing


@BOTH
def test_white_noise_seldom_looks_like_another(white, approach):
    """p-values of the tails are uniform, those of axes and colour are bounds; no level matters."""
    residuals = white[approach.name]
    assert_uniform(
        np.array([tail_test(r, chance(r, (2, i))).p_value for i, r in enumerate(residuals)])
    )
    found = np.array([evidence_of(r) for r in residuals])
    for k, test in enumerate((axis_test, colour_test)):
        p = np.array([test(r, x).p_value for r, x in zip(residuals, found[:, k], strict=True)])
        for level in (0.01, 0.05, 0.10):
            assert np.sum(p <= level) <= most(RUNS, level, RARE)
    larger = replace(residuals[0], errors=7 * residuals[0].errors)
    np.testing.assert_allclose(evidence_of(larger), found[0], atol=0.05)
    assert tail_test(larger, chance(larger, 3)).p_value == (
        tail_test(residuals[0], chance(residuals[0], 3)).p_value
    )


@BOTH
def test_white_noise_within_the_holds_explains_white_noise(white, approach):
    """F with r and 3 Σ (n_i − 1) degrees of freedom, here few enough that the latter matter."""
    rng = np.random.default_rng(5)
    n_samples = np.full(24, 4)
    p = []
    for r in white[approach.name]:
        sd = SIGMA * np.sqrt(4 * rng.chisquare(3, (24, 3)) / 3)
        p.append(within_hold_test(r, SIGMA, sd, n_samples).p_value)
    assert_uniform(np.array(p))


@pytest.mark.parametrize("scheme", ["mclaren-24", "rings-24", "faces-edges-corners-26"])
def test_readings_without_steps_have_none(scheme):
    """The search is a bound (Bonferroni); attitudes on a grid of their own are no steps either."""
    drawn = draw(6, scheme, noise=Noise(sigma_force=0.02), replicates=RUNS)
    p = np.array([resolution_test(forces, 0.02).p_value for forces in drawn.forces])
    for level in (0.01, 0.05, 0.10):
        assert np.sum(p <= level) <= most(RUNS, level, RARE)


# --- closed forms --------------------------------------------------------------------------------


def test_the_test_within_holds_is_the_f_test():
    rng = np.random.default_rng(8)
    z, sd = 1.3 * rng.standard_normal(30), rng.uniform(0.01, 0.02, (12, 3))
    n_samples = np.full(12, 25)
    found = within_hold_test(independent(z), 0.003, sd, n_samples)
    ratio = (z @ z / 30 * 0.003**2) / np.mean(sd**2 / 25)
    assert found.statistic == pytest.approx(ratio)
    assert found.p_value == pytest.approx(stats.f.sf(ratio, 30, 3 * 12 * 24))


def test_holds_that_say_nothing_of_their_noise_accuse_nothing():
    """One sample has no sd, and samples that are all the same only say that they were rounded."""
    z = independent(np.random.default_rng(9).standard_normal(30))
    sd = np.full((12, 3), 0.02)
    sd[:4] = 0
    counts = np.where(np.arange(12) < 4, 1, 100)
    some = within_hold_test(z, 0.002, sd, counts)
    assert some.p_value == within_hold_test(z, 0.002, sd[4:], counts[4:]).p_value
    for nothing in (
        within_hold_test(z, 0.002, np.zeros((12, 3)), np.full(12, 100)),
        within_hold_test(z, 0.002, np.zeros((12, 3)), np.ones(12, dtype=int)),
    ):
        assert nothing.p_value == 1
        assert np.isfinite(nothing.statistic)


# --- something is wrong --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("k", "effect"), [*enumerate(["axis_noise(kappa_z=16)", "coloured_noise(share=0.8, tau=3)"])]
)
def test_noise_of_a_kind_is_told_from_the_other(k, effect):
    """In 50 positions, by a robot without errors."""
    made = sessions(ROBOT, effect, seed=14, scheme="fibonacci-50", runs=20, sigma_angle=1e-6)
    found = np.array([evidence_of(r) for r in made[0]])
    assert np.mean(found[:, k] > found[:, 1 - k]) > 0.8
    assert np.mean(found[:, k] > np.log(400)) > 0.5


@pytest.mark.parametrize("lsb", [0.05, 0.2])
def test_steps_of_the_readings_are_found_and_measured(lsb):
    noise = Noise(sigma_force=0.01, effects=(f"quantisation(lsb={lsb})",))
    drawn = draw(15, "fibonacci-50", noise=noise, replicates=50)
    found = [resolution_test(forces, 0.01) for forces in drawn.forces]
    assert sum(t.p_value < 0.01 for t in found) >= least(50, 0.99, RARE)
    # Readings of ±g tell a wrong step once it is out by half a step there.
    steps = np.array([float(t.remark.split()[4]) for t in found]) / 1e3
    assert np.all(np.abs(steps / lsb - 1) < lsb / (4 * G))


@pytest.mark.parametrize("sigma", [1.0, 10.0, 1e3])
def test_a_sigma_as_large_as_gravity_makes_no_steps(sigma):
    """Readings that span less than some steps cannot show them."""
    forces = draw(17, "fibonacci-50").forces[0]
    assert resolution_test(forces, sigma).p_value == 1

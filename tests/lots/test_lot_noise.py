"""The noise of a lot as a factor of what each campaign says of it, by made-up calibrations."""

from types import SimpleNamespace

import numpy as np
import pytest

from accelstudy.diagnosis.evidence.size import Level
from accelstudy.diagnosis.rules import RULES
from accelstudy.lots.noise import agreement, noises_of_lot

N, REDUNDANCY = 16, 40
QUIET, ROUGH = 3e-4, 2e-3
"""m/s², of sensors that were held for a minute, and for a second."""
MIXED = np.where(np.arange(N) % 3 == 0, QUIET, ROUGH)


def fit(true, k, stated=None, within=None):
    """Calibration number k of a sensor with some noise; what its residuals tell is spread evenly.

    A chi-square variable of 40 degrees of freedom is within ±13 % of its mean in 2 of 3 cases.
    """
    ratio = 1 + 0.11 * np.linspace(-1.5, 1.5, N)[k * 7 % N]
    return SimpleNamespace(
        level=Level.of_nothing_stated() if stated is None else Level.of_stated_sigma(),
        within=None if within is None else np.full(3, within**2),
        solution=SimpleNamespace(
            redundancy=REDUNDANCY,
            approach=SimpleNamespace(uses_angles=False),
            sigma_force=stated or true * ratio,
            sigma_posteriori=true * ratio,
        ),
    )


def noises_of(fits):
    """Noise of sensors without angles, which are calibrated once."""
    asked = []
    noises = noises_of_lot(len(fits), lambda i, sigma: asked.append(sigma) or fits[i])
    assert asked == [None] * len(fits)
    return noises


def assert_sigmas(noises, sigmas, rtol=0.03):
    np.testing.assert_allclose([noise.sigma for noise in noises], sigmas, rtol=rtol)


def test_sensors_whose_stated_noise_differs_have_a_factor_in_common():
    noises = noises_of([fit(true, k, stated=2 * true) for k, true in enumerate(MIXED)])
    assert all(noise.stated and noise.freedom >= 60 for noise in noises)
    assert_sigmas(noises, MIXED)
    # So has what the samples within the holds tell.
    noises = noises_of([fit(true, k, within=true / 3) for k, true in enumerate(MIXED)])
    assert_sigmas(noises, MIXED)


def test_a_wrongly_stated_sigma_changes_that_of_no_other_sensor():
    stated = np.where(np.arange(N) == 5, MIXED / 8, MIXED)
    noises = noises_of(
        [fit(true, k, stated=u) for k, (true, u) in enumerate(zip(MIXED, stated, strict=True))]
    )
    assert_sigmas(noises, stated, 0.05)
    assert noises[5].freedom >= 20  # so its residuals are far beyond what it states


def test_sensors_that_say_nothing_pool_only_if_they_agree():
    """What is not said cannot be wrong."""
    noises = noises_of([fit(ROUGH, k) for k in range(N)])
    assert_sigmas(noises, ROUGH)
    assert not any(noise.stated for noise in noises)
    assert noises_of([fit(true, k) for k, true in enumerate(MIXED)]) == [None] * N
    # Those that say it are judged apart from those that do not.
    half = [fit(true, k, stated=true if k < N / 2 else None) for k, true in enumerate(MIXED)]
    noises = noises_of(half)
    assert noises[N // 2 :] == [None] * (N // 2)
    assert_sigmas(noises[: N // 2], MIXED[: N // 2], 0.05)
    assert noises_of([None, *half[:2]]) == [None] * 3  # two are no lot


def test_of_several_maxima_the_highest_is_found():
    """Two groups of sensors, of which the larger one is the usual one."""
    for few in (3, 13):
        sigmas = np.where(np.arange(N) < few, QUIET, ROUGH)
        factor, freedom = agreement(sigmas, np.full(N, REDUNDANCY))
        assert freedom == RULES.freedom_doubted or factor == pytest.approx(
            QUIET if few > N / 2 else ROUGH, rel=0.1
        )


@pytest.mark.parametrize("freedom", [8.0, 1e6])
def test_the_noise_of_a_type_is_found_beside_an_odd_sensor(freedom):
    """Variances of 400 sensors about 0.002² with a known scatter, and some with ten times that."""
    rng = np.random.default_rng(7)
    squares = 0.002**2 * (freedom / rng.chisquare(freedom, 400)) * rng.chisquare(12, 400) / 12
    squares[:8] *= 100
    factor, found = agreement(np.sqrt(squares) / 0.004, np.full(400, 12))
    assert factor == pytest.approx(0.5, rel=0.05)
    assert found == pytest.approx(min(freedom, 200.0), rel=0.5)


def test_beside_angles_the_noise_of_the_forces_is_searched_for():
    """Residuals have a part of the angles, which is known and no noise of the forces."""
    true, of_angles = 3 * ROUGH, ROUGH

    def calibrated(i, sigma):
        taken = ROUGH if sigma is None else sigma
        ratio = np.sqrt((true**2 + of_angles**2) / (taken**2 + of_angles**2))
        one = fit(taken * ratio, i, stated=taken)
        one.solution.approach.uses_angles = True
        return one

    assert_sigmas(noises_of_lot(N, calibrated), true)

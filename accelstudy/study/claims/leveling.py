"""Claims of section 3.1: variance propagation."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy import special

from accelstudy.basics.units import GON, MGON
from accelstudy.leveling.angles import angles_of, specific_force
from accelstudy.study.claims.base import Array, Claim, Evidence, register, verdict

DRAWS = 200_000


@register
def leveling_claims(evidence: Evidence) -> Iterable[Claim]:
    """Judge the claims of section 3.1."""
    level = simulated_tilts(evidence, 0, 0)
    for k, angle in enumerate(("roll", "pitch")):
        sd, low, high = sd_with_interval(level[:, k])
        yield Claim(
            f"level-{angle}",
            "3.1",
            f"{angle} is accurate to 13 mgon near level",
            "mgon",
            13.0,
            sd,
            low,
            high,
            verdict(abs(sd - 13) <= 0.5),
            f"σ/g gives {evidence.cell.noise.sigma_force / evidence.cell.gravity / MGON:.2f} mgon.",
        )
    rolled, low, high = sd_with_interval(simulated_tilts(evidence, 50, 0)[:, 0])
    yield Claim(
        "roll-does-not-matter",
        "3.1",
        "rolling the sensor changes neither accuracy",
        "mgon",
        13.0,
        rolled,
        low,
        high,
        verdict(abs(rolled - 13) <= 0.5),
        "At a roll of 50 gon the accuracy of roll is what it is at level.",
    )
    ten, low, high = sd_with_interval(simulated_tilts(evidence, 0, 50, 10.0)[:, 0])
    one = sd_with_interval(simulated_tilts(evidence, 0, 50)[:, 0])[0]
    yield Claim(
        "linear-in-noise",
        "3.1",
        "the sd of the tilt angles grows linearly with the noise (ten times the noise)",
        "ratio",
        10.0,
        ten / one,
        low / one,
        high / one,
        verdict(abs(ten / one - 10) <= 0.5),
        "Ten times the noise gives ten times the sd of roll at a pitch of 50 gon.",
    )


def simulated_tilts(evidence: Evidence, roll: float, pitch: float, factor: float = 1.0) -> Array:
    """Errors of roll and pitch (N, 2) in mgon of simulated readings in an attitude given in gon."""
    cell = evidence.cell
    rng = np.random.default_rng(np.random.SeedSequence([evidence.seed, 31]))
    force = np.array(specific_force(roll * GON, pitch * GON, cell.gravity))
    noise = factor * cell.noise.sigma_force * rng.standard_normal((DRAWS, 3))
    angles = angles_of(force + noise)
    return (angles - [roll * GON, pitch * GON]) / MGON


def sd_with_interval(values: Array) -> tuple[float, float, float]:
    """Empirical standard deviation with its 95 % confidence interval."""
    n = len(values)
    sd = float(np.std(values, ddof=1))
    # Quantiles of χ²; scipy.stats has them too, but is slow to import.
    low, high = 2 * special.gammaincinv((n - 1) / 2, [0.975, 0.025])
    return sd, sd * np.sqrt((n - 1) / low), sd * np.sqrt((n - 1) / high)

"""Coloured noise: noise that lasts longer than a hold."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from accelstudy.basics.arrays import Array
from accelstudy.basics.registry import Setting
from accelstudy.effects import HoldConditions
from accelstudy.noise_effects.base import NoiseEffect, register


def autocorrelation(lag: ArrayLike, tau: float) -> Array:
    """Autocorrelation φ = exp(−Δt/τ) of the process over lags; 1 where τ is infinite."""
    return np.asarray(np.exp(-np.asarray(lag, dtype=float) / tau))


def innovation_variance(phi: Array) -> Array:
    """Variance of the new part that keeps a process of autocorrelation φ stationary."""
    return np.asarray(1 - phi**2)


@register
class ColouredNoise(NoiseEffect):
    """A first-order Gauss–Markov process in addition to white noise (IEEE Std 952, annex C).

    Each axis has a stationary process m of its own with the autocorrelation exp(−|Δt|/τ). `share`
    is its share of the variance of a position mean: white noise keeps σ², so that the sum has
    σ² / (1 − share). Samples within a hold do not show it.

    With a τ far below the time between holds it is a random offset from hold to hold. With a τ far
    above the session it is a random walk about a constant, which the biases absorb. Where the holds
    have no time, τ counts holds.
    """

    name = "coloured_noise"
    takes = (Setting("share", "1", 0.5, above=0, below=1), Setting("tau", "s", 600.0, above=0))
    equation = "v + m, ρ(m) = exp(−|Δt|/τ), Var m = share/(1 − share) σ²"
    typical = (0.2, 0.8)

    def disturb(
        self, noise: Array, sigma: float, hold: HoldConditions, rng: np.random.Generator
    ) -> Array:
        """Return v + m, with m_k = φ_k m_(k−1) + √(1 − φ_k²) ε_k and φ_k = exp(−Δt_k/τ)."""
        share, tau = self.settings["share"], self.settings["tau"]
        time = np.arange(float(noise.shape[1])) if hold.time is None else hold.time
        coloured = rng.standard_normal(noise.shape)
        lasting = autocorrelation(np.diff(time), tau)
        for k, (phi, new) in enumerate(
            zip(lasting, np.sqrt(innovation_variance(lasting)), strict=True), 1
        ):
            coloured[:, k] = phi * coloured[:, k - 1] + new * coloured[:, k]
        return noise + sigma * math.sqrt(share / (1 - share)) * coloured

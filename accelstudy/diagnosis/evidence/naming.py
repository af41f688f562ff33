"""Naming: how probable each hypothesis is, given that something is missing.

For a hypothesis with an orthonormal basis Q (r, l) of its signature, Zellner's g-prior and an
unknown noise level give the evidence in closed form (Liang et al. 2008, eq. 5 and 6),

    log m = (r − l)/2 · log(1 + g) − r/2 · log(1 + g (1 − R²)),   R² = ‖Qᵀz‖²/‖z‖²,

relative to that of white noise alone, with g at its most likely value. Shapes of an effect share
its prior probability. Coloured noise is a hypothesis with a covariance matrix instead of a mean;
"unknown" is something in one of the groups of regressors that is none of the effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.diagnosis.evidence.colour import restricted_likelihoods
from accelstudy.diagnosis.evidence.screening import shares
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.spaces import Spaces

Array = NDArray[np.float64]

UNKNOWN = "unknown"
COLOUR = "coloured_noise"
LEVEL = "noise_level"
STRENGTHS = (0.25, 1.0, 4.0, 16.0, 64.0)
"""Variances of coloured noise beside that of white noise for which the evidence is averaged."""


def log_evidence(r_squared: ArrayLike, dim: ArrayLike, redundancy: int) -> Array:
    """Log evidence against white noise, at the most likely g."""
    t, dim = np.minimum(np.asarray(r_squared, dtype=float), 1 - 1e-12), np.asarray(dim)
    f = (t / dim) / ((1 - t) / (redundancy - dim))
    g = np.maximum(f - 1, 0.0)
    return (redundancy - dim) / 2 * np.log1p(g) - redundancy / 2 * np.log1p(g * (1 - t))


def shapes_evidence(shapes: Spaces, residuals: Residuals) -> Array:
    """Log evidence of each shape."""
    return log_evidence(shares(shapes, residuals.z), shapes.dims, residuals.redundancy)


def mean_evidence(logs: Array, weights: Array | None = None) -> float:
    """Log of the mean evidence of shapes, equally probable if no weights say otherwise."""
    top = float(np.max(logs))
    return top + float(np.log(np.average(np.exp(logs - top), weights=weights)))


def widths(shapes: Sequence[Hypothesis]) -> Array | None:
    """Weights of the trapezoidal rule over the logarithm of a smooth setting, (s,)."""
    if shapes[0].smooth is None or len(shapes) < 2:
        return None
    return np.asarray(np.gradient(np.log([h.value for h in shapes])))


def colour_evidence(residuals: Residuals) -> float:
    """Log evidence of coloured noise, mean over correlation lengths and strengths."""
    z, r = residuals.z, residuals.redundancy
    logs = restricted_likelihoods(residuals, STRENGTHS) + r / 2 * np.log(z @ z)
    return mean_evidence(logs.ravel())


def posterior(
    evidence: Mapping[str, float], prior: Mapping[str, float] | None = None
) -> dict[str, float]:
    """Posterior probabilities of hypotheses, sorted, most probable first."""
    prior = prior or {}
    logs = {name: value + np.log(prior.get(name, 1.0)) for name, value in evidence.items()}
    top = max(logs.values())
    weights = {name: float(np.exp(value - top)) for name, value in logs.items()}
    total = sum(weights.values())
    ranked = sorted(weights, key=lambda name: -weights[name])
    return {name: weights[name] / total for name in ranked}


def known_level_evidence(
    candidates: Mapping[str, Spaces], residuals: Residuals
) -> tuple[float, float, str]:
    """Compare a wrong noise level with effects in noise of the given level.

    Returns
    -------
    Log evidence that sigma is wrong (the variance factor at its most likely value, less half the
    logarithm of the redundancy for having been chosen), log evidence of the effects together, and
    the name of the strongest; relative to that sigma is right and nothing is missing.
    """
    z, r = residuals.z, residuals.redundancy
    omega = float(z @ z)
    level = -r / 2 * np.log(omega / r) - r / 2 + omega / 2 - np.log(r) / 2
    evidence = {}
    for name, shapes in candidates.items():
        parts, dims = shapes.parts(z), shapes.dims
        g = np.maximum(parts / dims - 1, 0.0)
        evidence[name] = mean_evidence(g / (1 + g) * parts / 2 - dims / 2 * np.log1p(g))
    best = max(evidence, key=lambda name: evidence[name])
    # A wrong sigma is as probable beforehand as all effects together.
    return float(level), mean_evidence(np.array(list(evidence.values()))), best

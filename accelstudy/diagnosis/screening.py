"""Screening: which hypotheses explain more of the residuals than chance does.

Each is tested by the share t = ‖Qᵀz‖²/‖z‖² of the residuals that its space takes up, which is
Beta(l/2, (r − l)/2) if nothing is missing, whatever the noise level is (the F test). A candidate
has many shapes and there are many candidates, so the smallest of all p-values is what counts; how
small it becomes by chance is found by simulation of residuals without any effect, over the same
shapes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from accelstudy.progress import track

Array = NDArray[np.float64]

SIMULATIONS = 1000
LEVEL = 0.05


@dataclass(frozen=True)
class Screening:
    """Outcome of the tests of all candidates.

    Attributes
    ----------
    p_single : dict of candidate to (s,) array, p-value of each shape by itself
    p_candidate : dict of candidate to p-value of its best shape among all of them
    p_family : dict of candidate to p-value of the best of all candidates (family-wise)
    best : dict of candidate to the index of its best shape
    """

    p_single: Mapping[str, Array]
    p_candidate: Mapping[str, float]
    p_family: Mapping[str, float]
    best: Mapping[str, int]

    @property
    def smallest(self) -> float:
        """Family-wise p-value of the whole."""
        return min(self.p_family.values(), default=1.0)

    @property
    def strongest(self) -> str:
        """Candidate with the smallest p-value."""
        return min(self.p_family, key=lambda name: self.p_family[name], default="")


def share(basis: Array, z: Array) -> Array:
    """Share of residuals (..., r) in the space of a basis (r, l)."""
    total = np.einsum("...r,...r->...", z, z)
    part = np.sum((z @ basis) ** 2, axis=-1)
    return np.minimum(part / np.where(total > 0, total, 1.0), 1.0)


def p_of_share(t: Array, dim: int, redundancy: int) -> Array:
    """Probability of a larger share by chance."""
    return np.asarray(special.betaincc(dim / 2, (redundancy - dim) / 2, t))


def screen(candidates: Mapping[str, Sequence[Array]], z: Array, null: Array) -> Screening:
    """Test all shapes of all candidates.

    Parameters
    ----------
    candidates : mapping of name to orthonormal bases (r, l), one per shape
    z : (r,) array
    null : (B, r) array, residuals without any effect
    """
    r = len(z)
    single: dict[str, Array] = {}
    candidate: dict[str, float] = {}
    by_chance: list[Array] = []
    for name, shapes in track(candidates.items(), "null simulation"):
        values = np.array([p_of_share(share(q, z), q.shape[1], r) for q in shapes])
        # Shapes of one dimension have p-values in the order of their shares.
        smallest = np.ones(len(null))
        for dim in {q.shape[1] for q in shapes}:
            shares = np.max([share(q, null) for q in shapes if q.shape[1] == dim], axis=0)
            smallest = np.minimum(smallest, p_of_share(shares, dim, r))
        number = _effective_number(smallest) if len(shapes) > 1 else 1.0
        single[name] = values
        candidate[name] = float(_any_of(values.min(), number))
        by_chance.append(_any_of(smallest, number))
    number = _effective_number(np.min(by_chance, axis=0)) if by_chance else 1.0
    return Screening(
        p_single=single,
        p_candidate=candidate,
        p_family={name: float(_any_of(p, number)) for name, p in candidate.items()},
        best={name: int(np.argmin(values)) for name, values in single.items()},
    )


def _effective_number(smallest: Array) -> float:
    """Number of independent tests whose smallest p-value has the same 5 % quantile."""
    quantile = float(np.quantile(smallest, LEVEL))
    return float(np.log1p(-LEVEL) / np.log1p(-min(quantile, LEVEL)))


def _any_of(p: ArrayLike, number: float) -> Array:
    """Probability that the smallest of independent p-values is below p."""
    return np.asarray(-np.expm1(number * np.log1p(-np.minimum(p, 1 - 1e-16))))

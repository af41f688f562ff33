"""Screening: which hypotheses explain more of the residuals than chance does.

Each is tested by the share t = ‖Qᵀz‖²/‖z‖² of the residuals that its space takes up, which is
Beta(l/2, (r − l)/2) if nothing is missing, whatever the noise level is (the F test). A candidate
has many shapes and there are many candidates, so the smallest of all p-values is what counts; how
small it becomes by chance is found by simulation of residuals without any effect, over the same
shapes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from accelstudy.diagnosis.space.spaces import Spaces

Array = NDArray[np.float64]

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


def shares(spaces: Spaces, z: Array) -> Array:
    """Shares (..., s) of residuals (..., m) in some spaces."""
    total = np.einsum("...m,...m->...", z, z)[..., None]
    return np.minimum(spaces.parts(z) / np.where(total > 0, total, 1.0), 1.0)


def p_of_share(t: Array, dim: ArrayLike, redundancy: int) -> Array:
    """Probability of a larger share by chance."""
    dim = np.asarray(dim)
    return np.asarray(special.betaincc(dim / 2, (redundancy - dim) / 2, t))


def screen(
    candidates: Mapping[str, Spaces], z: Array, redundancy: int, null: Iterable[Array]
) -> Screening:
    """Test all shapes of all candidates.

    Parameters
    ----------
    candidates : mapping of name to the spaces of its shapes
    z : (m,) array
    redundancy : int, r
    null : arrays (b, m) of residuals without any effect
    """
    single: dict[str, Array] = {}
    candidate: dict[str, float] = {}
    by_chance: list[Array] = []
    drawn = [
        {name: _largest(spaces, errors) for name, spaces in candidates.items()} for errors in null
    ]
    for name, spaces in candidates.items():
        dims = spaces.dims
        values = p_of_share(shares(spaces, z), dims, redundancy)
        # Shapes of one dimension have p-values in the order of their shares.
        largest = np.concatenate([part[name] for part in drawn])
        smallest = p_of_share(largest, np.unique(dims), redundancy).min(axis=1)
        number = _effective_number(smallest) if len(dims) > 1 else 1.0
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


def _largest(spaces: Spaces, errors: Array) -> Array:
    """Largest shares (b, d) of residuals (b, m) in the spaces of each dimension, ascending."""
    found = shares(spaces, errors)
    return np.stack(
        [found[:, spaces.dims == dim].max(axis=1) for dim in np.unique(spaces.dims)], axis=1
    )


def _effective_number(smallest: Array) -> float:
    """Number of independent tests whose smallest p-value has the same 5 % quantile."""
    quantile = float(np.quantile(smallest, LEVEL))
    return float(np.log1p(-LEVEL) / np.log1p(-min(quantile, LEVEL)))


def _any_of(p: ArrayLike, number: float) -> Array:
    """Probability that the smallest of independent p-values is below p."""
    return np.asarray(-np.expm1(number * np.log1p(-np.minimum(p, 1 - 1e-16))))

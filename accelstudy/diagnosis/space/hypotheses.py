"""Hypotheses about what the model lacks: each shape of an effect is a space of residuals.

Two things count of a space: its dimension, and the size of the part of the residuals that lies in
it. Many spaces of one kind are evaluated together. No matrix of all conditions by all conditions is
formed, so the effort grows with the number of positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, TypeAlias, overload

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import root_of
from accelstudy.diagnosis.space.residuals import Residuals, position_products
from accelstudy.effects import Effect

Array = NDArray[np.float64]
ALIKE = 0.9999
"""Canonical cosine above which two signatures are the same."""

OUTLIER = "outlier_position"


class Spaces(Protocol):
    """Some spaces of residuals."""

    @property
    def dims(self) -> NDArray[np.int_]:
        """Their dimensions, (s,)."""

    def parts(self, errors: Array) -> Array:
        """Squares of what residuals (..., m) have in each of them, (..., s)."""


@dataclass(frozen=True)
class Bases:
    """Spaces given by orthonormal bases in the residual space.

    Attributes
    ----------
    together : (m, Σ l) array, one basis beside the other
    dims : (s,) int array, l
    """

    together: Array
    dims: NDArray[np.int_]

    @classmethod
    def beside_each_other(cls, bases: Sequence[Array]) -> Bases:
        """Gather bases (m, l)."""
        dims = np.array([basis.shape[1] for basis in bases])
        return cls(np.concatenate(bases, axis=1), dims)

    def split(self) -> list[Array]:
        """Each of the bases, (m, l)."""
        return np.split(self.together, self.ends[1:-1], axis=1)

    def parts(self, errors: Array) -> Array:
        """Squares of what residuals (..., m) have in each of them, (..., s)."""
        return np.add.reduceat((errors @ self.together) ** 2, self.ends[:-1], axis=-1)

    @cached_property
    def ends(self) -> NDArray[np.int_]:
        """Where the bases begin and the last one ends, (s + 1,)."""
        return np.concatenate([[0], np.cumsum(self.dims)])


@dataclass(frozen=True)
class Hypothesis:
    """One shape of one thing that may be missing.

    Attributes
    ----------
    name : str, canonical name
    effect : Effect; None for what is no effect of the sensor or the rig
    directions : (k, l) array, combinations of the parameters that the positions show
    basis : (m, l) array, orthonormal, of the space of its signature in the residuals
    ideal : (m, l) array, likewise for an ideal sensor, at which equal effects are exactly equal
    place : int, index of the position that was bumped; None for an effect
    estimates : (l, l) array, turns products of the basis with residuals into the l parameters that
        show most; None for effects whose parameters have no bounds
    """

    name: str
    effect: Effect | None
    directions: Array
    basis: Array
    ideal: Array
    place: int | None = None
    estimates: Array | None = None

    @property
    def dim(self) -> int:
        """Number of parameters that show."""
        return self.basis.shape[1]

    @property
    def shown(self) -> Effect | None:
        """Return the effect with as many of its parameters as the positions can tell apart.

        Those that no position shows are left out, unless something is known of them a priori.
        Where only combinations show, the parameters that are kept stand for them, and the others
        are zero.
        """
        if self.effect is None or self.effect.informed:
            return self.effect
        if self.dim == len(self.effect.parameters):
            return self.effect
        from scipy.linalg import qr  # slow to import, and seldom needed

        order = qr(self.directions.T, mode="r", pivoting=True)[1]
        return self.effect.only(tuple(sorted(order[: self.dim].tolist())))

    @property
    def smooth(self) -> str | None:
        """Name of the setting with which the effect changes smoothly, if it has one.

        An effect that lacks what the setting shapes is no neighbour of those that do not.
        """
        if self.effect is None:
            return None
        values = self.effect.settings
        smooth = (s.name for s in self.effect.takes if s.smooth and values[s.name] != s.none)
        return next(smooth, None)

    @property
    def value(self) -> float:
        """Value of the smooth setting; NaN if it has none."""
        if self.effect is None or self.smooth is None:
            return np.nan
        return self.effect.settings[self.smooth]


@dataclass(frozen=True)
class EffectShapes(Bases, Sequence[Hypothesis]):
    """Shapes of one effect.

    Attributes
    ----------
    hypotheses : tuple of Hypothesis, whose bases are columns of `together`
    """

    hypotheses: tuple[Hypothesis, ...]

    @classmethod
    def of(cls, hypotheses: Sequence[Hypothesis]) -> EffectShapes:
        """Gather shapes."""
        bases = Bases.beside_each_other([h.basis for h in hypotheses])
        shared = zip(hypotheses, bases.split(), strict=True)
        return cls(bases.together, bases.dims, tuple(replace(h, basis=q) for h, q in shared))

    def drawn(self, places: NDArray[np.int_], amounts: Array) -> Array:
        """Sum the columns of some bases, (b, m), with weights (Σ l,), one basis after the other."""
        dims = self.dims[places]
        rows = np.repeat(np.arange(len(places)), dims)
        first = np.repeat(self.ends[places] - (np.cumsum(dims) - dims), dims)
        columns = np.zeros((len(places), self.together.shape[1]))
        columns[rows, first + np.arange(len(rows))] = amounts
        return np.asarray(columns @ self.together.T)

    def __len__(self) -> int:
        return len(self.hypotheses)

    @overload
    def __getitem__(self, index: int) -> Hypothesis: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Hypothesis, ...]: ...
    def __getitem__(self, index: int | slice) -> Hypothesis | tuple[Hypothesis, ...]:
        return self.hypotheses[index]


@dataclass(frozen=True)
class BumpedPositions(Sequence[Hypothesis]):
    """One hypothesis per position: its conditions are shifted by an arbitrary amount.

    Its space is spanned by R E_i H_i, with E_i the columns of the unit matrix that belong to the
    position and H_i H_iᵀ = R_ii⁺. The part of z in it is H_iᵀ z_i.

    Attributes
    ----------
    residuals : Residuals
    places : (s,) int array, the positions that others control
    root : (s, c, c) array, H of these; columns of zeros for what is not controlled
    dims : (s,) int array
    """

    residuals: Residuals
    places: NDArray[np.int_]
    root: Array
    dims: NDArray[np.int_]

    @classmethod
    def of(cls, residuals: Residuals) -> BumpedPositions:
        """All positions that the others control."""
        root, rank = root_of(residuals.blocks)
        places = np.flatnonzero((rank > 0) & (rank < residuals.redundancy))
        return cls(residuals, places, root[places], rank[places])

    def parts(self, errors: Array) -> Array:
        """Squares of what residuals (..., m) have in each of them, (..., s)."""
        parts = position_products(errors, self.root, self.places)
        return np.sum([part**2 for part in parts], axis=0)

    def __len__(self) -> int:
        return len(self.places)

    @overload
    def __getitem__(self, index: int) -> Hypothesis: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Hypothesis, ...]: ...
    def __getitem__(self, index: int | slice) -> Hypothesis | tuple[Hypothesis, ...]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        place = int(self.places[index])
        where, directions = self.rows_of(int(index))
        rows = np.zeros((len(self.residuals.design), directions.shape[1]))
        rows[where] = directions
        basis = self.residuals.project(rows)
        return Hypothesis(OUTLIER, None, directions, basis, basis, place)

    def drawn(self, places: NDArray[np.int_], amounts: Array) -> Array:
        """Sum the columns of some bases as `EffectShapes.drawn` does, but without R, (b, m)."""
        n, c = len(self.residuals.whitening), self.root.shape[-1]
        each = np.zeros((len(places), c))
        # The columns of H that are zero are the first ones.
        each[np.arange(c) >= c - self.dims[places, None]] = amounts
        sums = np.zeros((len(places), len(self.residuals.design)))
        blocks = sums[:, : n * c].reshape(-1, n, c)
        blocks[np.arange(len(places)), self.places[places]] = np.einsum(
            "bij,bj->bi", self.root[places], each
        )
        return sums

    def rows_of(self, index: int) -> tuple[slice, Array]:
        """Rows of the conditions of one position, and its H there, (c, l); R E H is a basis."""
        place, root = int(self.places[index]), self.root[index]
        c = len(root)
        return slice(place * c, (place + 1) * c), root[:, np.any(root != 0, axis=0)]


Shapes: TypeAlias = EffectShapes | BumpedPositions
"""All shapes of one thing that may be missing: a sequence of hypotheses, and their spaces."""


def cosines(a: Array, b: Array) -> Array:
    """Canonical cosines of two spaces with orthonormal bases, descending."""
    return np.clip(np.linalg.svd(a.T @ b, compute_uv=False), 0.0, 1.0)


def same_space(a: Hypothesis, b: Hypothesis) -> bool:
    """Whether two hypotheses cannot be told apart in these positions."""
    if a.dim != b.dim:
        return False
    return bool(cosines(a.ideal, b.ideal)[-1] > ALIKE)

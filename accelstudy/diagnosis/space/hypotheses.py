"""Everything that may be missing: alternatives, each with a covariance of the residuals.

An effect in one of its shapes, or an outlier position, is a space of residuals, K = Q Qᵀ/l: nothing
is known of its l parameters. A smooth function of a coordinate has a covariance of its own
(`accelstudy.diagnosis.space.shapes`). Of unknown size, each adds λ K to that of the noise.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import root_of
from accelstudy.basics.arrays import Array
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.effects import Effect

if TYPE_CHECKING:
    from accelstudy.diagnosis.evidence.size import Evidence


OUTLIER = "outlier_position"


class _Shift(Effect):
    """What an outlier position has in place of an effect: nothing that a model could have."""

    name, parameters = OUTLIER, ()


SHIFT = _Shift()


@dataclass(frozen=True)
class Hypothesis:
    """One shape of one thing that may be missing.

    Attributes
    ----------
    name : str, canonical name
    effect : Effect, in this shape
    directions : (k, l) array, combinations of the parameters that the positions show
    basis : (m, l) array, orthonormal, of the space of its signature in the residuals
    ideal : (m, l) array, likewise for an ideal sensor, at which equal effects are exactly equal
    outlier : int, index of the outlier position; None for an effect
    estimates : (l, l) array, turns products of the basis with residuals into the l parameters that
        show most; None for effects whose parameters have no bounds
    """

    name: str
    effect: Effect
    directions: Array
    basis: Array
    ideal: Array
    outlier: int | None = None
    estimates: Array | None = None

    @property
    def dim(self) -> int:
        """Number of parameters that show."""
        return self.basis.shape[1]

    @property
    def distinguishable(self) -> Effect:
        """Return the effect with as many of its parameters as the positions can tell apart.

        Those that no position shows are left out, unless something is known of them a priori.
        Where only combinations show, the parameters that are kept stand for them, and the others
        are zero.
        """
        if self.effect.informed or self.dim == len(self.effect.parameters):
            return self.effect
        from scipy.linalg import qr  # slow to import, and seldom needed

        order = qr(self.directions.T, mode="r", pivoting=True)[1]
        return self.effect.with_parameters(tuple(sorted(order[: self.dim].tolist())))

    @property
    def smooth(self) -> str | None:
        """Name of the setting with which the effect changes smoothly, if it has one.

        An effect that lacks what the setting shapes is no neighbour of those that do not.
        """
        values = self.effect.settings
        smooth = (s.name for s in self.effect.takes if s.smooth and values[s.name] != s.none)
        return next(smooth, None)

    @property
    def value(self) -> float:
        """Value of the smooth setting; NaN if it has none."""
        return np.nan if self.smooth is None else self.effect.settings[self.smooth]


@dataclass(frozen=True)
class Shapes(ABC):
    """Alternatives of one thing that may be missing: s covariances λ K of the residuals.

    Attributes
    ----------
    prior : (s,) array, prior probabilities, which sum to 1
    dims : (s,) int array, ranks l of the K
    vectors : (m, Σ l) array, their eigenvectors, one shape beside the other
    """

    prior: Array
    dims: NDArray[np.int_]
    vectors: Array

    @cached_property
    def ends(self) -> NDArray[np.int_]:
        """First vector of each shape, and the end of the last one, (s + 1,)."""
        return np.concatenate([[0], np.cumsum(self.dims)])

    def split(self, along: Array) -> list[Array]:
        """Divide what there is of each eigenvector, (..., Σ l), by shape."""
        return np.split(along, self.ends[1:-1], axis=-1)

    @abstractmethod
    def logs(self, evidence: Evidence, errors: Array) -> Array:
        """Log density of residuals (..., m) under each shape, (..., s)."""

    def log_density(self, evidence: Evidence, errors: Array) -> Array:
        """Log density of residuals (..., m) over all shapes, (...)."""
        return log_sum(self.logs(evidence, errors) + np.log(self.prior))


class Spaces(Shapes):
    """Shapes of which nothing is known but a space: all eigenvalues of a K are equal."""

    def parts(self, errors: Array) -> Array:
        """Squares of what residuals (..., m) have in each space, (..., s)."""
        return np.add.reduceat((errors @ self.vectors) ** 2, self.ends[:-1], axis=-1)

    def logs(self, evidence: Evidence, errors: Array) -> Array:
        """Log density of residuals (..., m) under each shape, (..., s)."""
        squares = np.sum(errors**2, axis=-1)
        return evidence.spaces_density(self.parts(errors), self.dims, squares)


@dataclass(frozen=True)
class Hypotheses(Spaces):
    """Spaces that are hypotheses with a name: the shapes of an effect, or all outlier positions.

    Attributes
    ----------
    prior : (s,) array, even over the logarithm of a smooth setting, else even
    dims, vectors : as in `Shapes`
    hypotheses : tuple of Hypothesis, whose bases are columns of the vectors
    """

    hypotheses: tuple[Hypothesis, ...]

    @classmethod
    def of(cls, hypotheses: Sequence[Hypothesis]) -> Hypotheses:
        """Hypotheses with their prior probabilities as shapes of one thing."""
        weights, dims = np.ones(len(hypotheses)), np.array([h.dim for h in hypotheses])
        if len(hypotheses) > 1 and hypotheses[0].smooth is not None:
            weights = np.gradient(np.log([h.value for h in hypotheses]))
        vectors = np.concatenate([h.basis for h in hypotheses], axis=1)
        shapes = cls(weights / weights.sum(), dims, vectors, ())
        each = zip(hypotheses, shapes.split(vectors), strict=True)
        return replace(shapes, hypotheses=tuple(replace(h, basis=basis) for h, basis in each))

    def __len__(self) -> int:
        return len(self.hypotheses)

    def __getitem__(self, index: int) -> Hypothesis:
        return self.hypotheses[index]

    def strongest(self, z: Array) -> Hypothesis:
        """Shape that explains most of residuals z (m,)."""
        return self[int(np.argmax(self.parts(z)))]


def outlying_positions(residuals: Residuals) -> list[Hypothesis]:
    """One hypothesis per position that others control: its conditions are shifted at will.

    Its space is spanned by R E_i H_i, with E_i the columns of the unit matrix that belong to the
    position and H_i H_iᵀ = R_ii⁺.
    """
    root, rank = root_of(residuals.blocks)
    c, found = root.shape[-1], []
    for place in np.flatnonzero((rank > 0) & (rank < residuals.redundancy)).tolist():
        shift = root[place][:, np.any(root[place] != 0, axis=0)]
        rows = np.zeros((len(residuals.design), shift.shape[1]))
        rows[place * c : (place + 1) * c] = shift
        basis = residuals.project(rows)
        found.append(Hypothesis(OUTLIER, SHIFT, shift, basis, basis, place))
    return found


# --- positions of one attitude: their differences are noise alone, whatever the model lacks -------


def space_of_attitudes(residuals: Residuals, labels: NDArray[np.int_]) -> Array:
    """Orthonormal basis (m, l) of what positions with one label have in common: no differences.

    A change of conditions by t that is the same in all positions of an attitude is L_iᵀ t at unit
    weight (but for what varies between them). Of these directions, orthonormal within each
    attitude, those are left that the model does not absorb.
    """
    n, c = residuals.whitening.shape[:2]
    attitudes, which = np.unique(labels, return_inverse=True)
    normal = np.zeros((len(attitudes), c, c))
    np.add.at(normal, which, residuals.whitening @ np.swapaxes(residuals.whitening, 1, 2))
    weights = np.linalg.inv(np.linalg.cholesky(normal))[which] @ residuals.whitening
    rest = len(residuals.design) - n * c
    same = np.zeros((n * c + rest, len(attitudes) * c + rest))
    for i, k in enumerate(which):
        same[i * c : (i + 1) * c, k * c : (k + 1) * c] = weights[i].T
    same[n * c :, len(attitudes) * c :] = np.eye(rest)  # observed gravity is by itself
    left, values, _ = np.linalg.svd(same.T @ residuals.absorbed)
    absorbed = np.count_nonzero(values > RULES.absorbed)
    return np.asarray(same @ left[:, absorbed:])


def repeats_of(residuals: Residuals, forces: Array) -> Spaces | None:
    """What repeated positions have in common; None if no attitude was measured twice.

    Nor is there any where the model absorbs all of it, or the repeats leave no redundancy.

    Parameters
    ----------
    residuals : Residuals
    forces : (n, 3) array, specific forces of the positions
    """
    labels = clusters(forces)
    if len(np.unique(labels)) == len(forces):
        return None
    basis = space_of_attitudes(residuals, labels)
    dim = basis.shape[1]
    return Spaces(np.ones(1), np.array([dim]), basis) if 0 < dim < residuals.redundancy else None


def clusters(forces: Array) -> NDArray[np.int_]:
    """Label positions by attitude; positions with the same label repeat each other."""
    unit = forces / np.linalg.norm(forces, axis=1, keepdims=True)
    labels = -np.ones(len(unit), dtype=int)
    for i, here in enumerate(unit):
        if labels[i] < 0:
            near = np.linalg.norm(unit - here, axis=1) < RULES.same_attitude
            labels[near & (labels < 0)] = i
    return labels


# --- arithmetic -----------------------------------------------------------------------------------


def log_sum(logs: Array) -> Array:
    """Log of the sum of exp(logs) over the last axis, faster than `np.logaddexp.reduce`."""
    top = np.max(logs, axis=-1, keepdims=True)
    return np.asarray(top[..., 0] + np.log(np.sum(np.exp(logs - top), axis=-1)))


def joint_basis(hypotheses: Sequence[Hypothesis], m: int) -> Array:
    """Orthonormal basis (m, l) of the spaces of some hypotheses together."""
    bases = [np.zeros((m, 0)), *(h.basis for h in hypotheses)]
    return np.asarray(np.linalg.qr(np.concatenate(bases, axis=1))[0])


def cosines(a: Array, b: Array) -> Array:
    """Canonical cosines of two spaces with orthonormal bases, descending."""
    return np.clip(np.linalg.svd(a.T @ b, compute_uv=False), 0.0, 1.0)


def same_space(a: Hypothesis, b: Hypothesis) -> bool:
    """Whether two hypotheses cannot be told apart in these positions."""
    if a.dim != b.dim:
        return False
    return bool(cosines(a.ideal, b.ideal)[-1] > RULES.alike)

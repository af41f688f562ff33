"""Shapes: what is missing as a smooth function of a coordinate, whether it has a name or not.

A shape is a coordinate of the holds, a target that depends on it, and a smoothness. Its function is
h(c) = Σ_j w_j φ_j(c), with the φ_j and the prior variances S_j of the w_j that `effects.smooth`
has. In the space of residuals it has the covariance λ K, K = Φ S Φᵀ scaled to the trace 1, with Φ
what the model leaves of the functions. An effect of the catalogue is the case K = Q Qᵀ/d.

Because S falls with the frequency, a shape does not pay for all of its dimensions.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from accelstudy.basics.arrays import Array
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import HoldColumns, SessionFit
from accelstudy.diagnosis.space.hypotheses import Shapes, Spaces, log_sum
from accelstudy.effects.learned import TARGETS, added_by
from accelstudy.effects.smooth import (
    CYCLES,
    LENGTHS,
    ORDERS,
    frequencies,
    harmonics,
    sines,
    spectrum,
)
from accelstudy.leveling.angles import wrap_angle

if TYPE_CHECKING:
    from accelstudy.diagnosis.evidence.size import Evidence


DIRECTIONS, SPHERE_DIRECTIONS = 12, 60
"""Functions of the direction of gravity for each axis, and directions that they are made of."""
MAX_DIRECTIONS, MIN_TRACE_SHARE = 24, 2e-3
"""Directions of a shape that are kept at most, and the least share of the trace of each."""

Place: TypeAlias = tuple[str, str]
"""A coordinate, and the target that depends on it."""


OF_ATTITUDE = ("force", "bias")
"""Place of anything that repeated positions of one attitude have in common."""
SLOW_PLACES = (("time", "bias"), ("time", "scale"))
"""Places of what follows something that nobody recorded, such as a temperature."""


@dataclass(frozen=True)
class LearnedShapes(Shapes):
    """Something without a name: shapes, and anything of the attitude alone where that repeats.

    Attributes
    ----------
    prior : (s,) array, even over the coordinates, then over their targets, over the kinds of
        functions that are tried of each, and over their smoothness; the attitude counts as one
        coordinate. Where a column is absent, slow changes with time have more
    dims, vectors : as in `Shapes`
    shares : tuple of s arrays (l,), eigenvalues of each K, which sum to 1
    places : tuple of Place, s
    attitude : Spaces or None, everything but the differences of repeated positions, the last place
    """

    shares: tuple[Array, ...]
    places: tuple[Place, ...]
    attitude: Spaces | None = None

    @classmethod
    def of(cls, frame: SessionFit, attitude: Spaces | None = None) -> LearnedShapes:
        """All shapes that the coordinates of a session allow, and that its model leaves.

        Parameters
        ----------
        frame : SessionFit
        attitude : Spaces or None, what repeated positions of one attitude have in common
        """
        places: list[Place] = []
        kinds: list[int] = []
        covariances: list[Array] = []
        for kind, (place, rows, priors) in enumerate(_functions(frame)):
            projected = frame.residuals.project(rows)
            left, total = np.sum(projected**2, axis=0), np.sum(rows**2, axis=0)
            for prior in priors[priors @ left > RULES.visible * (priors @ total)]:
                used = prior > MIN_TRACE_SHARE * prior.max()
                places.append(place)
                kinds.append(kind)
                covariances.append(projected[:, used] * np.sqrt(prior[used]))
        targets = Counter(coordinate for coordinate, _ in dict.fromkeys(places))
        of_place = Counter(dict(zip(kinds, places, strict=True)).values())
        settings = Counter(kinds)
        weights = np.array([
            1 / (len(targets) * targets[place[0]] * of_place[place] * settings[kind])
            for place, kind in zip(places, kinds, strict=True)
        ])  # fmt: skip
        shapes = cls._of(places, weights, covariances, len(frame.residuals.design))
        if attitude is not None:
            share = 1 / (len(targets) + 1)
            prior = np.append(weights * (1 - share), share)
            shapes = replace(shapes, places=(*places, OF_ATTITUDE), prior=prior, attitude=attitude)
        if frame.absent and shapes.is_slow.any():
            # Some of what changes slowly follows what nobody recorded.
            slow = np.where(shapes.is_slow, shapes.prior, 0.0)
            prior = RULES.prior_unknown * shapes.prior + RULES.prior_unrecorded * slow / slow.sum()
            return replace(shapes, prior=prior / prior.sum())
        return shapes

    @property
    def is_slow(self) -> NDArray[np.bool_]:
        """Which shapes, (s,), may be those of what nobody recorded, such as a temperature."""
        return np.array([place in SLOW_PLACES for place in self.places], dtype=bool)

    @classmethod
    def _of(
        cls, places: Sequence[Place], weights: Array, roots: Sequence[Array], m: int
    ) -> LearnedShapes:
        """Decompose covariances C Cᵀ, given by C (m, l), scaled to the trace 1."""
        vectors, shares = [np.zeros((m, 0))], []
        for root in roots:
            values, turned = np.linalg.eigh(root.T @ root)
            significant = np.flatnonzero(values > MIN_TRACE_SHARE * values.sum())[-MAX_DIRECTIONS:]
            vectors.append(root @ (turned[:, significant] / np.sqrt(values[significant])))
            shares.append(values[significant] / values[significant].sum())
        dims = np.array([len(share) for share in shares], dtype=int)
        return cls(weights, dims, np.concatenate(vectors, axis=1), tuple(shares), tuple(places))

    def orthogonal_to(self, basis: Array) -> LearnedShapes:
        """What is left of the shapes beside a space with an orthonormal basis (m, l)."""
        left = self.vectors - basis @ (basis.T @ self.vectors)
        roots = self.split(left * np.sqrt(np.concatenate([np.zeros(0), *self.shares])))
        seen = [i for i, root in enumerate(roots) if np.sum(root**2) > RULES.visible]
        places, weights = [self.places[i] for i in seen], self.prior[seen]
        return self._of(places, weights / weights.sum(), [roots[i] for i in seen], len(basis))

    def logs(self, evidence: Evidence, errors: Array) -> Array:
        """Log density of residuals (..., m) under each shape, (..., s)."""
        logs = [np.zeros((*errors.shape[:-1], 0))]
        if self.shares:
            rows = np.atleast_2d(errors)
            along = self.split((rows @ self.vectors) ** 2)
            seen = evidence.shapes_density(along, self.shares, np.sum(rows**2, axis=-1))
            logs.append(seen.reshape(*errors.shape[:-1], -1))
        if self.attitude is not None:
            logs.append(self.attitude.logs(evidence, errors))
        return np.concatenate(logs, axis=-1)

    def place_densities(self, evidence: Evidence, errors: Array) -> dict[Place, Array]:
        """Log density of residuals (..., m) under the shapes of each place, times its prior."""
        logs = self.logs(evidence, errors) + np.log(self.prior)
        of_place = {p: [q == p for q in self.places] for p in dict.fromkeys(self.places)}
        return {place: log_sum(logs[..., some]) for place, some in of_place.items()}


# --- coordinates --------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Coordinate:
    """Functions of a coordinate of the holds.

    Attributes
    ----------
    name : str
    targets : tuple of str, what may depend on it
    values : (n, a) array, the coordinate in the holds, of a arguments
    functions : (n, a, k) array, k functions of each argument
    priors : (p, k) array, prior variances of their weights by smoothness
    """

    name: str
    targets: tuple[str, ...]
    values: Array
    functions: Array
    priors: Array


ANY_TARGET = tuple(TARGETS)
"""What may depend on anything that changes from hold to hold, whatever the attitude."""
TURNING = ("mounting", "reading", "tilt")
"""Targets that turn the force, to which gravity alone is blind."""


def coordinate_in_holds(name: str, frame: SessionFit) -> Array:
    """Return a coordinate of a place in each hold, (n, a) for its a arguments, SI."""
    return next(one.values for one in _coordinates(frame) if one.name == name)


def _coordinates(frame: SessionFit) -> Iterator[_Coordinate]:
    """Coordinates of a session that vary."""
    hold, f, angles = frame.hold, frame.sensed, frame.angles

    def smooth(name: str, targets: tuple[str, ...], values: Array) -> Iterator[_Coordinate]:
        if np.ptp(values, axis=0).max() > 0:
            yield _Coordinate(name, targets, values, *_sines(values))

    yield from smooth("force", ("bias", "bias of the others"), f)
    yield _Coordinate("force", ("bias",), f, *_on_the_sphere(f))
    yield _Coordinate("angle", ("reading",), angles, *_harmonics(angles))
    if hold.yaw is not None and np.ptp(hold.yaw) > 0:
        yaw = hold.yaw[:, None]
        yield _Coordinate("yaw", ANY_TARGET, yaw, *_harmonics(yaw))
    if hold.vibration is not None:
        yield from smooth("vibration", ANY_TARGET, hold.vibration[:, None])
    if hold.temperature is not None:
        yield from smooth("temperature", ANY_TARGET, hold.temperature[:, None])
    if getattr(hold, frame.course) is None or np.ptp(hold.column(frame.course)) == 0:
        return
    when = hold.column(frame.course)
    yield from smooth("time", ANY_TARGET, when[:, None])
    yield _Coordinate("time", ("bias",), when[:, None], *_waves(when))
    before = np.concatenate([f[:1], f[:-1]])
    yield from smooth("previous", ("bias", "scale"), before)
    yield from smooth("next", ("bias",), np.append(f[1:], f[-1:], 0) - f)
    moved = wrap_angle(np.diff(angles, axis=0, prepend=angles[:1]))
    yield from smooth("move", ("reading",), moved)
    if hold.temperature is not None and np.all(np.diff(when) > 0):
        rates = np.diff(hold.temperature) / np.diff(when)
        last = np.append(rates[:1], rates)
        for rate in (last, (last + np.append(rates, rates[-1:])) / 2):
            yield from smooth("dT/dt", ANY_TARGET, rate[:, None])


def _sines(values: Array) -> tuple[Array, Array]:
    """Sines of a coordinate (n, a), and their prior variances."""
    low, high = values.min(axis=0), values.max(axis=0)
    half = np.where(high > low, (high - low) / 2, 1.0)
    functions = np.stack(sines((values - (low + high) / 2) / half, np), axis=-1)
    return functions, spectrum(frequencies(), LENGTHS)


def _harmonics(angles: Array) -> tuple[Array, Array]:
    """Harmonics of angles (n, a), and their prior variances."""
    functions = np.stack(harmonics(angles, np), axis=-1)
    return functions, np.tile(spectrum(ORDERS, LENGTHS), 2)


def _waves(when: Array) -> tuple[Array, Array]:
    """Sines and cosines of time, one number of cycles at a time."""
    phase = 2 * np.pi * CYCLES / np.ptp(when) * (when - when.min())[:, None]
    waves = np.concatenate([np.sin(phase), np.cos(phase)], axis=1)
    return waves[:, None], np.tile(np.eye(len(CYCLES)), 2)


def _on_the_sphere(f: Array) -> tuple[Array, Array]:
    """Functions of the direction of forces (n, 3), smooth by any of two lengths."""
    unit = f / np.linalg.norm(f, axis=1, keepdims=True)
    # Of many directions some will do: the functions are smooth (Nyström).
    some = unit[np.unique(np.linspace(0, len(unit) - 1, SPHERE_DIRECTIONS).round().astype(int))]
    features, weights = [], []
    for length in LENGTHS[1:]:
        values, vectors = np.linalg.eigh(_covariance(some, some, length))
        largest = values[-DIRECTIONS:]
        features.append(_covariance(unit, some, length) @ vectors[:, -DIRECTIONS:] / largest)
        weights.append(largest)
    return np.concatenate(features, axis=1)[:, None], np.asarray(block_diag(*weights))


def _covariance(one: Array, other: Array, length: float) -> Array:
    """Covariance of a smooth function at unit vectors, by the squares of their chords."""
    return np.asarray(np.exp((one @ other.T - 1) / length**2))


# --- targets ------------------------------------------------------------------------------------

NAMED_TARGETS = {"square": "scale", "bias of the others": "bias"}
"""Targets of which more is tried: a scale of the square, a bias by the forces of other axes."""
PAIRS = tuple((i, j) for i in range(3) for j in range(3) if i != j)


def _functions(frame: SessionFit) -> Iterator[tuple[Place, Array, Array]]:
    """Functions of all places: their rows of unit weight (m, k), and prior variances (p, k).

    Their means over the holds are zero: what is the same in all of them is no function.
    """
    residuals, robot = frame.residuals, frame.solution.approach.uses_angles
    by_force, by_angle = np.split(residuals.by_observations, [3], axis=-1)
    for one in _coordinates(frame):
        varying = one.functions - one.functions.mean(axis=0)
        for target in one.targets:
            place = (one.name, NAMED_TARGETS.get(target, target))
            if target in TURNING and not robot:
                continue
            if target == "reading":
                change = by_angle @ _for_each_component(varying, 2)
            else:
                change = by_force @ _change(varying, target, frame)
            rows = residuals.stack(change)
            count = rows.shape[1] // one.priors.shape[1]
            # Only a bias is tried that changes as fast as that.
            rough = target != "bias" and len(one.priors) == len(LENGTHS)
            yield place, rows, np.tile(one.priors[rough:], count)


def _change(h: Array, target: str, frame: SessionFit) -> Array:
    """Change of the output, (n, 3, l), by functions h (n, a, k) of a target."""
    f, n = frame.sensed, len(frame.sensed)
    if target == "bias of the others":
        parts = np.zeros((n, 3, len(PAIRS), h.shape[2]))
        for k, (i, j) in enumerate(PAIRS):
            parts[:, i, k] = h[:, j]
        return parts.reshape(n, 3, -1)
    units, hold = np.eye(len(TARGETS[target][0])), HoldColumns(frame.hold, 1)
    x, y, z = f.T[..., None]
    shown = added_by(target, [*units], (x, y, z), frame.solution.gravity, hold, np)
    by_unit = np.stack([np.broadcast_to(each, (n, len(units))) for each in shown], axis=1)
    return np.asarray(by_unit @ _for_each_component(h, len(units)))


def _for_each_component(h: Array, count: int) -> Array:
    """Give each of so many components functions (n, a, k) of its own, (n, count, count k).

    They are of its own argument or, where there is one argument for all, of that.
    """
    n, _, k = h.shape
    each = np.broadcast_to(h, (n, count, k))
    return np.einsum("nik,ij->nijk", each, np.eye(count)).reshape(n, count, -1)

"""The likelihood-ratio oracle: the best answer for a campaign if all but the answer is known.

It knows sigma, the sensor, the shapes of all effects, how many are missing and how large they are.
It detects by the smallest p-value of all likelihood ratios. The total evidence of all effects, of
known size, would detect a little more of small effects (at λ = 10: 0.48 for 0.41). It names the
most probable answer, which no method beats on average.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, softmax

from studies.hidden.physics.conditions import Conditions, Shape
from studies.hidden.physics.designs import session
from studies.hidden.physics.geometry import GRAVITY, Array
from studies.hidden.physics.kinds import EFFECTS, NOWHERE, Cause, Kind
from studies.hidden.physics.measuring import Sensor, observe

Class = tuple[str, ...]

ROUNDING = 1e-12  # share of the readings themselves up to which an effect is only their rounding
ALIKE = 0.9999  # canonical cosine from which on two effects are the same
OUTSIDE_SHARE = 0.15
"""Least share that two effects of the catalogue leave of the noncentrality of one outside it."""
DRAWS = 7  # draws of an effect, most of which must be outside the catalogue
LEVEL = 0.05
CREDIBLE = 0.9  # probability with which a set of alternatives holds the truth
SAME = 5e-5  # largest one less the cosine of two directions of a pair that count as one
SIMULATIONS = 4000  # misclosures without any effect, for the level of the smallest p-value


@dataclass(frozen=True)
class Verdict:
    """What the oracle says.

    Attributes
    ----------
    detected : bool, something is missing, at a level of 5 %
    best : tuple of classes of names, what is missing; empty if nothing is detected
    told : tuple of classes of names, what is missing, if it is told that something is
    alternatives : int, how many effects it needs, if told, to hold the truth with `CREDIBLE`;
        of one effect only, 0 else
    """

    detected: bool
    best: tuple[Class, ...]
    told: tuple[Class, ...]
    alternatives: int = 0


class Oracle:
    """What is known of a session by one approach: all shapes that a calibration can see of it.

    Attributes
    ----------
    conditions : Conditions, of an ideal sensor
    """

    def __init__(self, conditions: Conditions) -> None:
        self.conditions, self.session = conditions, conditions.session

    def shape(self, effect: Kind, settings: dict[str, float]) -> Shape | None:
        """Shape of an effect with any settings; None if it cannot be seen."""
        k, sigma = effect.k, self.session.sigma
        steps = effect.typical * np.eye(k)
        cause = Cause(effect, settings, np.concatenate([steps, -steps]))
        output, reading = observe(self.session, self.conditions.sensor, (cause,))
        seen = self.conditions.seen(output, reading)
        left, force, angle = ((each[:k] - each[k:]) / 2 for each in (seen, output, reading))
        raw = np.hypot(np.linalg.norm(force), GRAVITY * np.linalg.norm(angle))
        size = float(raw / sigma / np.sqrt(k))
        readings = float(np.linalg.norm(self.conditions.directions)) * GRAVITY / sigma
        if size < ROUNDING * readings:  # else what is left would be a matter of the processor
            return None
        return Shape.of(effect, settings, left, size)

    @cached_property
    def shapes(self) -> tuple[Shape, ...]:
        """Shapes of all effects, in settings that cover all their values."""
        candidates = (
            self.shape(effect, settings)
            for effect in EFFECTS.values()
            if effect.shows(self.session)
            for settings in effect.grid(self.session)
        )
        return tuple(shape for shape in candidates if shape is not None)

    @cached_property
    def visible(self) -> tuple[str, ...]:
        """Names of the effects that can be seen."""
        return tuple(dict.fromkeys(shape.effect.name for shape in self.shapes))

    @property
    def invisible(self) -> tuple[str, ...]:
        """Names of the effects that the session has, but that cannot be seen."""
        had = (name for name, effect in EFFECTS.items() if effect.shows(self.session))
        return tuple(name for name in had if name not in self.visible)

    @cached_property
    def dims(self) -> NDArray[np.int_]:
        """Dimensions of all shapes."""
        return np.array([shape.dim for shape in self.shapes])

    @cached_property
    def together(self) -> Array:
        """Bases of all shapes side by side, (m, k)."""
        return np.concatenate([shape.basis for shape in self.shapes], axis=1)

    def parts(self, z: Array) -> Array:
        """Squares of what misclosures (..., m) have in each shape, (..., s)."""
        starts = np.cumsum(self.dims) - self.dims
        return np.asarray(np.add.reduceat((z @ self.together) ** 2, starts, axis=-1))

    def same_as(self, shape: Shape) -> tuple[str, ...]:
        """Names of the effects with a shape that cannot be told from the given one."""
        others = [one for one in self.shapes if one.dim == shape.dim]
        products = shape.basis.T @ np.array([one.basis for one in others])
        least = np.linalg.svd(products, compute_uv=False)[:, -1] if others else ()
        alike = [one for one, cosine in zip(others, least, strict=True) if cosine > ALIKE]
        names = {one.effect.name for one in (shape, *alike)}
        return tuple(name for name in EFFECTS if name in names)

    @cached_property
    def threshold(self) -> float:
        """Smallest p-value of a shape that chance beats in 5 % of all campaigns."""
        m = len(self.together)
        z = np.random.default_rng(m).standard_normal((SIMULATIONS, m))
        smallest = np.min(self._p_values(self.conditions.left(z)), axis=1)
        return float(np.quantile(smallest, LEVEL))

    @cached_property
    def pairs(self) -> Pairs:
        """All pairs of shapes of different effects."""
        return Pairs(self)

    @cached_property
    def classes(self) -> tuple[Class, ...]:
        """What each shape cannot be told from."""
        return tuple(self.same_as(shape) for shape in self.shapes)

    def is_outside(self, change: Array) -> bool:
        """Whether misclosures (m,) are not like those of any two effects of the catalogue."""
        size = float(change @ change)
        return size - float(np.max(self.pairs.parts(change))) > OUTSIDE_SHARE * size

    def judge(self, z: Array, sizes: Sequence[float]) -> Verdict:
        """Judge a campaign.

        Parameters
        ----------
        z : (m,) array, misclosures of the calibrated campaign, less what the parameters absorb
        sizes : sequence of float, true noncentralities of what is missing
        """
        detected = bool(np.min(self._p_values(z)) < self.threshold)
        told, alternatives = tuple[Class, ...](), 0
        if len(sizes) == 2:
            pairs = self.pairs
            logs = _evidence(pairs.parts(z), pairs.dims, float(sum(sizes)))
            _, best = _most_probable(logs, pairs.starts)
            told = self.classes[pairs.first[best]], self.classes[pairs.second[best]]
        elif len(sizes) < 2:  # of three it would have to try too many
            # Where nothing is missing, or nothing of the catalogue, any usual size will do.
            logs = _evidence(self.parts(z), self.dims, sizes[0] if sizes else 25.0)
            names = [shape.effect.name for shape in self.shapes]
            starts = np.array([names.index(name) for name in self.visible])
            of_effects, best = _most_probable(logs, starts)
            told, by_class = (self.classes[best],), dict[Class, float]()
            for i, log in zip(starts, of_effects, strict=True):
                alike = self.classes[i]
                by_class[alike] = float(np.logaddexp(by_class.get(alike, -np.inf), log))
            p = np.sort(softmax([*by_class.values()]))[::-1]
            alternatives = int(np.searchsorted(np.cumsum(p), CREDIBLE)) + 1
        return Verdict(detected, told if detected else (), told, alternatives)

    def _p_values(self, z: Array) -> Array:
        return np.asarray(chdtrc(self.dims, self.parts(z)))


class Pairs:
    """Pairs of shapes of different effects, those of the same two next to each other.

    Attributes
    ----------
    first, second : (q,) int arrays, shapes
    dims : (q,) array, dimensions of both together
    starts : (g,) int array, first pair of each two effects
    cosines : (g,) array, largest canonical cosine of any shapes of each two effects
    """

    def __init__(self, knowing: Oracle) -> None:
        order = {name: i for i, name in enumerate(knowing.visible)}
        effect = np.array([order[shape.effect.name] for shape in knowing.shapes])
        first, second = np.nonzero(effect[:, None] < effect[None, :])
        group = effect[first] * len(order) + effect[second]
        sorted_ = np.argsort(group, kind="stable")
        first, second, group = first[sorted_], second[sorted_], group[sorted_]
        self.first, self.second = first, second
        # Bases with columns of zeros, so that all are equally wide, (s, m, d).
        d = int(knowing.dims.max())
        self._bases = np.stack([np.pad(s.basis, ((0, 0), (0, d - s.dim))) for s in knowing.shapes])
        flat = self._bases.transpose(1, 0, 2).reshape(self._bases.shape[1], -1)
        products = (flat.T @ flat).reshape(len(effect), d, len(effect), d)
        # With both bases B side by side the square is zᵀ B (Bᵀ B)⁺ Bᵀ z.
        both = np.stack([first, second], axis=1)
        normal = products[both[:, :, None], :, both[:, None, :], :].transpose(0, 1, 3, 2, 4)
        values, vectors = np.linalg.eigh(normal.reshape(len(both), 2 * d, 2 * d))
        kept = values > SAME
        weights = np.where(kept, 1 / np.where(kept, values, 1.0), 0.0)
        self._inverse = (vectors * weights[:, None, :]) @ np.swapaxes(vectors, 1, 2)
        self.dims = np.sum(kept, axis=1, dtype=float)
        self.starts = np.flatnonzero(np.diff(group, prepend=-1))
        # Those of two bases and their cosines c are 1 ± c.
        self.cosines = np.maximum.reduceat(values[:, -1], self.starts) - 1

    def parts(self, z: Array) -> Array:
        """Squares of what misclosures (m,) have in each pair, (q,)."""
        components = np.einsum("smd,m->sd", self._bases, z)
        both = np.concatenate([components[self.first], components[self.second]], axis=1)
        return np.asarray(np.sum(np.matmul(both[:, None, :], self._inverse)[:, 0] * both, axis=1))


def _most_probable(evidence: Array, starts: NDArray[np.int_]) -> tuple[Array, int]:
    """Log evidence of groups, that of their members on average, and the best member of the best."""
    counts = np.diff(starts, append=len(evidence))
    logs = np.logaddexp.reduceat(evidence, starts) - np.log(counts)
    best = int(np.argmax(logs))
    return logs, int(starts[best] + np.argmax(evidence[starts[best] :][: counts[best]]))


def _evidence(parts: Array, dims: Array | NDArray[np.int_], size: float) -> Array:
    """Log evidence of effects of a size against none, with directions that are all as likely."""
    gain = size / dims
    return np.asarray(-dims / 2 * np.log1p(gain) + gain / (1 + gain) * parts / 2)


@cache
def oracle(design: str, approach: str) -> Oracle:
    """The oracle of a design by an approach."""
    return Oracle(Conditions(session(design), approach, Sensor()))


@cache
def visible_outside(design: str, approach: str) -> tuple[str, ...]:
    """Names of effects outside the catalogue that show, and that no two effects of it imitate."""
    knowing = oracle(design, approach)

    def shows(name: str, kind: Kind) -> bool:
        # No kind changes what another one draws.
        rng = np.random.default_rng(zlib.crc32(name.encode()))
        drawn = (knowing.shape(kind, kind.draw(knowing.session, rng)) for _ in range(DRAWS))
        changes = (one.basis @ rng.standard_normal(one.dim) for one in drawn if one is not None)
        return sum(map(knowing.is_outside, changes)) > DRAWS / 2

    had = {name: kind for name, kind in NOWHERE.items() if kind.shows(knowing.session)}
    return tuple(name for name, kind in had.items() if shows(name, kind))

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

from studies.hidden.physics.atlas import Atlas, Conditions
from studies.hidden.physics.designs import session
from studies.hidden.physics.geometry import Array
from studies.hidden.physics.kinds import NOWHERE
from studies.hidden.physics.measuring import Sensor

Class = tuple[str, ...]

OUTSIDE_SHARE = 0.15
"""Least share that two effects of the catalogue leave of the noncentrality of one outside it."""
DRAWS = 7
"""Draws of an effect, most of which must be outside the catalogue."""
LEVEL = 0.05
CREDIBLE = 0.9
"""Probability with which a set of alternatives holds the truth."""
SAME = 5e-5
"""Largest one less the cosine of two directions of a pair that count as one."""
SIMULATIONS = 4000
"""Misclosures without any effect, for the level of the smallest p-value."""


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


class Oracle(Atlas):
    """The oracle of a session by one approach: an atlas of it, by which campaigns are judged."""

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
        if len(sizes) > 2:  # of which it would have to try too many
            return Verdict(detected, (), (), 0)
        if len(sizes) == 2:
            told, alternatives = self._two(z, float(sum(sizes))), 0
        else:
            told, alternatives = self._one(z, sizes)
        return Verdict(detected, told if detected else (), told, alternatives)

    def _p_values(self, z: Array) -> Array:
        return np.asarray(chdtrc(self.dims, self.parts(z)))

    def _one(self, z: Array, sizes: Sequence[float]) -> tuple[tuple[Class, ...], int]:
        # Where nothing is missing, or nothing of the catalogue, any usual size will do.
        size = sizes[0] if sizes else 25.0
        names = [shape.effect.name for shape in self.shapes]
        starts = np.array([i for i, name in enumerate(names) if i == 0 or name != names[i - 1]])
        logs, best = _most_probable(_evidence(self.parts(z), self.dims, size), starts)
        by_class: dict[Class, float] = {}
        for i, log in zip(starts, logs, strict=True):
            alike = self.classes[i]
            by_class[alike] = float(np.logaddexp(by_class.get(alike, -np.inf), log))
        p = np.sort(softmax([*by_class.values()]))[::-1]
        return (self.classes[best],), int(np.searchsorted(np.cumsum(p), CREDIBLE)) + 1

    def _two(self, z: Array, size: float) -> tuple[Class, ...]:
        pairs = self.pairs
        _, best = _most_probable(_evidence(pairs.parts(z), pairs.dims, size), pairs.starts)
        return (self.classes[pairs.first[best]], self.classes[pairs.second[best]])


class Pairs:
    """Pairs of shapes of different effects, those of the same two next to each other.

    Attributes
    ----------
    first, second : (q,) int arrays, shapes
    dims : (q,) array, dimensions of both together
    starts : (g,) int array, first pair of each two effects
    """

    def __init__(self, atlas: Atlas) -> None:
        order = {name: i for i, name in enumerate(atlas.visible)}
        effect = np.array([order[shape.effect.name] for shape in atlas.shapes])
        first, second = np.nonzero(effect[:, None] < effect[None, :])
        group = effect[first] * len(order) + effect[second]
        sorted_ = np.argsort(group, kind="stable")
        first, second, group = first[sorted_], second[sorted_], group[sorted_]
        self.first, self.second = first, second
        # Bases with columns of zeros, so that all are equally wide, (s, m, d).
        d = int(atlas.dims.max())
        self._bases = np.stack([np.pad(s.basis, ((0, 0), (0, d - s.dim))) for s in atlas.shapes])
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

    def parts(self, z: Array) -> Array:
        """Squares of what misclosures (m,) have in each pair, (q,)."""
        components = np.einsum("smd,m->sd", self._bases, z)
        both = np.concatenate([components[self.first], components[self.second]], axis=1)
        return np.asarray(np.sum(np.matmul(both[:, None, :], self._inverse)[:, 0] * both, axis=1))


def _most_probable(evidence: Array, starts: NDArray[np.int_]) -> tuple[Array, int]:
    """Log evidence of groups, that of their members on average, and the best member of the best."""
    counts = np.diff(np.append(starts, len(evidence)))
    top = np.maximum.reduceat(evidence, starts)
    sums = np.add.reduceat(np.exp(evidence - np.repeat(top, counts)), starts)
    logs = top + np.log(sums / counts)
    start, count = (int(each[np.argmax(logs)]) for each in (starts, counts))
    return logs, start + int(np.argmax(evidence[start : start + count]))


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
    knowing, visible = oracle(design, approach), []
    for name, effect in NOWHERE.items():
        if not effect.shows(knowing.session):
            continue
        # No kind changes what another one draws.
        rng, outside = np.random.default_rng(zlib.crc32(name.encode())), 0
        for _ in range(DRAWS):
            shape = knowing.shape(effect, effect.draw(knowing.session, rng))
            if shape is not None:
                direction = rng.standard_normal(shape.dim)
                outside += knowing.is_outside(shape.basis @ direction)
        if outside > DRAWS / 2:
            visible.append(name)
    return tuple(visible)

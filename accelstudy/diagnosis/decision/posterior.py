"""One posterior over everything that could be the case once something is missing.

Fewer explanations are reported than were weighed (`Posterior.reported`). All kinds of wrong noise
count as one, named by the most probable of them. Where one effect is more probable than several, a
set counts for the most probable of its effects, and likewise a set of three for the most probable
of its pairs where two are more probable. "This effect is missing" then leaves open whether a second
one, too small to be seen, is missing as well.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy import special

from accelstudy.diagnosis.evidence.candidates import UNKNOWN, Cause
from accelstudy.diagnosis.evidence.noise import NOISES
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.effects import effect_names


@dataclass(frozen=True)
class Explanation:
    """One thing that could be the case, or several together.

    Attributes
    ----------
    causes : tuple of Cause
    log_weight : float, log of density times prior weight
    posterior : float, probability given that something is missing, among those that are compared
    """

    causes: tuple[Cause, ...]
    log_weight: float = np.nan
    posterior: float = np.nan

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the causes."""
        return tuple(one.name for one in self.causes)

    @property
    def classes(self) -> tuple[tuple[str, ...], ...]:
        """The names that mean the same in this campaign, for each name."""
        return tuple(one.members for one in self.causes)

    @property
    def best(self) -> tuple[Hypothesis, ...]:
        """Shapes that explain most; empty if noise or something unknown is among them."""
        shapes = tuple(one.best for one in self.causes if one.best is not None)
        return shapes if len(shapes) == len(self.causes) else ()

    @property
    def is_effects(self) -> bool:
        """Whether it is of effects alone."""
        return all(members[0] in effect_names() for members in self.classes)

    @property
    def is_noise(self) -> bool:
        """Whether nothing is wrong but the noise."""
        return self.names[0] in NOISES


NOT_LISTED = Cause(UNKNOWN, (UNKNOWN,))
"""Something unknown."""


def rank_explanations(explanations: Iterable[Explanation]) -> tuple[Explanation, ...]:
    """Explanations that exclude each other, with their probabilities, most probable first."""
    order = sorted(explanations, key=lambda one: -one.log_weight)
    p = special.softmax([one.log_weight for one in order]).tolist()
    return tuple(replace(one, posterior=share) for one, share in zip(order, p, strict=True))


@dataclass(frozen=True)
class Posterior:
    """Probabilities given that something is missing or wrong.

    Attributes
    ----------
    all : tuple of Explanation, that exclude each other, most probable first; empty where nothing is
        missing
    """

    all: tuple[Explanation, ...] = ()

    @classmethod
    def of(cls, weighed: Sequence[Explanation]) -> Posterior:
        """Posterior of explanations; those that mean the same in this campaign become one."""
        merged: dict[tuple[tuple[str, ...], ...], Explanation] = {}
        for one in sorted(weighed, key=lambda one: -one.log_weight):
            key = tuple(sorted(one.classes))
            same = merged.setdefault(key, one)
            if same is not one:
                total = float(np.logaddexp(same.log_weight, one.log_weight))
                merged[key] = replace(same, log_weight=total)
        return cls(rank_explanations(merged.values()))

    @cached_property
    def reported(self) -> tuple[Explanation, ...]:
        """Explanations that are reported, most probable first."""
        if not self.all:
            return ()
        noise = next((i for i, one in enumerate(self.all) if one.is_noise), None)
        size, parts = self._size, dict[tuple[tuple[str, ...], ...], int]()
        for i, one in enumerate(self.all):
            if one.best and len(one.names) == size:
                parts[tuple(sorted(one.classes))] = i
        counted = {i: float(one.log_weight) for i, one in enumerate(self.all)}
        for i, one in enumerate(self.all):
            into = None
            if one.is_noise:
                into = noise
            elif len(one.names) > size:
                within = (tuple(sorted(some)) for some in combinations(one.classes, size))
                into = min((parts[some] for some in within if some in parts), default=None)
            if into is not None and into < i:
                counted[into] = float(np.logaddexp(counted[into], counted.pop(i)))
        return rank_explanations(replace(self.all[i], log_weight=log) for i, log in counted.items())

    @property
    def _size(self) -> int:
        """Number of effects: the least that is more probable than all larger ones together."""
        several = [one for one in self.all if one.best or len(one.names) > 1]
        sizes, posteriors = [len(one.names) for one in several], [one.posterior for one in several]
        each = np.bincount(sizes, weights=posteriors, minlength=2)
        return int(np.argmax(each > np.cumsum(each[::-1])[::-1] - each))

    @cached_property
    def credible_set(self) -> tuple[Explanation, ...]:
        """Smallest set of explanations that holds the truth with a probability of 0.9."""
        held = np.cumsum([one.posterior for one in self.reported])
        return self.reported[: int(np.searchsorted(held, RULES.credible)) + 1]

    @property
    def p_noise(self) -> float:
        """Probability that nothing is wrong but the noise."""
        return sum(one.posterior for one in self.reported if one.is_noise)

    def doubting(self, names: Collection[str]) -> Posterior:
        """Share what has some names with something unknown that they may only imitate."""
        shared: list[Explanation] = []
        for one in self.all:
            others = [cause for cause in one.causes if cause.name != UNKNOWN]
            remaining = [cause for cause in others if not {*cause.members} & {*names}]
            if len(remaining) == len(others):
                shared.append(one)
                continue
            imitated = one.log_weight + np.log(RULES.prior_imitated)
            real = one.log_weight + np.log(1 - RULES.prior_imitated)
            unknown = Explanation((*remaining, NOT_LISTED), float(imitated))
            shared += [replace(one, log_weight=float(real)), unknown]
        return Posterior.of(shared)

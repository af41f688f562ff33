"""One posterior over everything that could be the case once something is missing.

Fewer explanations are told than were weighed (`Posterior.told`). All kinds of wrong noise count as
one, named by the most probable of them. Where one effect is more probable than two, a pair counts
for the more probable of its two effects. "This effect is missing" then leaves open whether a second
one, too small to be seen, is missing as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import softmax

from accelstudy.diagnosis.decision.explanations import Explanation, credible_set
from accelstudy.diagnosis.evidence.noise.kinds import NOISES
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.effects import effect_names


@dataclass(frozen=True)
class Weighed:
    """Something that could be the case, with its evidence.

    Attributes
    ----------
    names : tuple of str, one or two
    classes : tuple of tuple of str, the names that mean the same, for each
    log_weight : float, log of density times prior weight
    best : tuple of Hypothesis, shapes that explain most; empty for noise and for the unknown
    """

    names: tuple[str, ...]
    classes: tuple[tuple[str, ...], ...]
    log_weight: float
    best: tuple[Hypothesis, ...] = ()


@dataclass(frozen=True)
class Posterior:
    """Probabilities given that something is missing or wrong.

    Attributes
    ----------
    all : tuple of Weighed, that exclude each other
    """

    all: tuple[Weighed, ...]

    @classmethod
    def of(cls, weighed: Sequence[Weighed]) -> Posterior:
        """Gather them; those that mean the same in this campaign become one."""
        merged: dict[tuple[tuple[str, ...], ...], Weighed] = {}
        for one in sorted(weighed, key=lambda one: -one.log_weight):
            key = tuple(sorted(one.classes))
            if key not in merged:
                merged[key] = one
                continue
            strongest = merged[key]
            total = float(np.logaddexp(strongest.log_weight, one.log_weight))
            merged[key] = Weighed(strongest.names, strongest.classes, total, strongest.best)
        return cls(tuple(sorted(merged.values(), key=lambda one: -one.log_weight)))

    @cached_property
    def told(self) -> tuple[Weighed, ...]:
        """Those that are told, most probable first."""
        noise = next((i for i, one in enumerate(self.all) if one.names[0] in NOISES), None)
        single = {
            one.classes[0]: i for i, one in enumerate(self.all) if len(one.names) == 1 and one.best
        }
        pairs = [i for i, one in enumerate(self.all) if len(one.names) == 2]
        p = self.probabilities
        alone = sum(p[i] for i in single.values()) > sum(p[i] for i in pairs)
        counted = {i: float(one.log_weight) for i, one in enumerate(self.all)}
        for i, one in enumerate(self.all):
            into = None
            if one.names[0] in NOISES:
                into = noise
            elif len(one.names) == 2 and alone:
                into = min((single[c] for c in one.classes if c in single), default=None)
            if into is not None and into < i:
                counted[into] = float(np.logaddexp(counted[into], counted.pop(i)))
        told = [replace(self.all[i], log_weight=log) for i, log in counted.items()]
        return tuple(sorted(told, key=lambda one: -one.log_weight))

    @cached_property
    def probabilities(self) -> tuple[float, ...]:
        """Posterior of each that was weighed, in the order of `all`."""
        return _shares(self.all)

    @cached_property
    def explanations(self) -> tuple[Explanation, ...]:
        """What is told, most probable first."""
        return tuple(
            Explanation(one.names, one.classes, p)
            for one, p in zip(self.told, _shares(self.told), strict=True)
        )

    @property
    def credible_set(self) -> tuple[Explanation, ...]:
        """Smallest set of explanations that holds the truth with a probability of 0.9."""
        return credible_set(self.explanations)

    @property
    def top(self) -> Weighed:
        """The most probable of those that are told."""
        return self.told[0]

    @property
    def of_noise(self) -> float:
        """Probability that nothing is wrong but the noise."""
        return sum(one.posterior for one in self.explanations if one.names[0] in NOISES)


def _shares(weighed: Sequence[Weighed]) -> tuple[float, ...]:
    """Probabilities of things that exclude each other."""
    return tuple(softmax([one.log_weight for one in weighed]).tolist())


def of_effects(explanation: Explanation) -> bool:
    """Whether an explanation is of effects alone."""
    return all(members[0] in effect_names() for members in explanation.classes)

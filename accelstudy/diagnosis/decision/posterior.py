"""One posterior over everything that could be the case once something is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from accelstudy.diagnosis.decision.explanations import Explanation, credible_set
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
        """Gather; what means the same in this campaign is one."""
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
    def probabilities(self) -> tuple[float, ...]:
        """Posterior of each, largest first."""
        logs = np.array([one.log_weight for one in self.all])
        weights = np.exp(logs - logs.max())
        return tuple((weights / weights.sum()).tolist())

    @cached_property
    def explanations(self) -> tuple[Explanation, ...]:
        """All of them as explanations, most probable first."""
        return tuple(
            Explanation(one.names, one.classes, p)
            for one, p in zip(self.all, self.probabilities, strict=True)
        )

    @property
    def credible_set(self) -> tuple[Explanation, ...]:
        """Smallest set of explanations that holds what is the case with 0.9."""
        return credible_set(self.explanations)

    @property
    def top(self) -> Weighed:
        """The most probable."""
        return self.all[0]

    def of_single(self, name: str) -> float:
        """Probability that something alone, or its class, is the case."""
        return next(
            (e.posterior for e in self.explanations if len(e.names) == 1 and name in e.classes[0]),
            0.0,
        )


def of_effects(explanation: Explanation) -> bool:
    """Whether an explanation is of effects alone."""
    return all(members[0] in effect_names() for members in explanation.classes)

"""Explanations of what is missing, and the smallest set of them that holds it credibly."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

CREDIBLE = 0.9
"""Posterior probability that a credible set reaches."""


@dataclass(frozen=True)
class Explanation:
    """One thing that is missing, or two together.

    Attributes
    ----------
    names : tuple of str, one or two: effects, or a noise effect, "outlier_position" or "unknown"
    classes : tuple of tuple of str, the names that mean the same in this campaign, for each name
    posterior : float, probability given that something is missing
    """

    names: tuple[str, ...]
    classes: tuple[tuple[str, ...], ...]
    posterior: float


def credible_set(
    explanations: Iterable[Explanation], probability: float = CREDIBLE
) -> tuple[Explanation, ...]:
    """Most probable explanations, until they hold a probability together.

    Parameters
    ----------
    explanations : that exclude each other
    probability : float
    """
    chosen: list[Explanation] = []
    for explanation in sorted(explanations, key=lambda one: -one.posterior):
        chosen.append(explanation)
        if sum(one.posterior for one in chosen) >= probability:
            break
    return tuple(chosen)

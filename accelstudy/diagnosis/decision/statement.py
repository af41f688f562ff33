"""What explanations say as a whole: what is certain, and what is open.

Explanations of near rivals share the posterior, so that each has little of it. Together they may
leave no doubt that a slow change in time is missing, say, and with it an even nonlinearity, while
none of the four pairs that could be meant has 0.4. So the statement is made of components: each
effect of the most probable explanation, with whatever stands in its place in the others. A
component is certain if the explanations that have it hold 0.9, and its names are alike; its names
are a credible set of their own, as those of Wang et al. (2020, J. R. Stat. Soc. B 82, 1273).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations
from typing import TypeAlias

from accelstudy.campaign.gross_errors.recognition import GROSS_ERRORS
from accelstudy.diagnosis.decision.posterior import Explanation
from accelstudy.diagnosis.evidence.candidates import UNKNOWN, Cause
from accelstudy.diagnosis.rules import RULES
from accelstudy.effects import effect_names, get_effect
from accelstudy.noise_effects import get_noise_effect, noise_effect_names

Names = tuple[str, ...]
Cosine: TypeAlias = Callable[[str, str], float]

DIGITS = 9
"""Decimals to which sums of the same probabilities agree."""


def family_of(*names: str) -> str:
    """Return the family that effects, noise effects or gross errors have in common, or nothing.

    Names that stand for none of these, such as "unknown", belong to no family.
    """
    families = {_family(name) for name in names}
    return families.pop() if len(families) == 1 else ""


def _family(name: str) -> str:
    """Family of a name of the catalogue; empty if it is none."""
    if name in effect_names():
        return get_effect(name).family
    if name in noise_effect_names():
        return get_noise_effect(name).family
    return "gross error" if name in GROSS_ERRORS else ""


@dataclass(frozen=True)
class Part:
    """One thing that is missing for certain, by the names that it may have.

    Attributes
    ----------
    family : str, what its names have in common in plain words; "" if they have nothing
    names : tuple of Cause, most probable first: its credible set
    posterior : float, that it is missing, whatever its name is
    purity : float, smallest canonical cosine of two of its names; None if it has one name
    """

    family: str
    names: tuple[Cause, ...]
    posterior: float
    purity: float | None

    @property
    def is_effect(self) -> bool:
        """Whether it is an effect or a gross error, and nothing unknown."""
        return self.names[0].name != UNKNOWN


@dataclass(frozen=True)
class Statement:
    """What is known of what is missing.

    Attributes
    ----------
    certain : tuple of Part, most probable first
    open : tuple of Explanation, what may be missing beside them, most probable first; one without
        names stands for nothing. Empty if nothing is beside them
    """

    certain: tuple[Part, ...] = ()
    open: tuple[Explanation, ...] = ()


def statement_of(
    explanations: Sequence[Explanation], cosine: Cosine, probability: float = RULES.credible
) -> Statement:
    """Say what explanations leave no doubt of, and what they leave open.

    Of a credible set, which does not hold all explanations, the probabilities are lower bounds.

    Parameters
    ----------
    explanations : Explanations that exclude each other
    cosine : function of two names, the canonical cosine of their signatures
    probability : float, that is enough to be certain
    """
    effects = [one for one in explanations if not one.is_noise]
    if not effects:
        return Statement((), tuple(explanations))
    top = max(effects, key=lambda one: one.posterior)
    matches = [_match(top, one, cosine) for one in explanations]
    parts = dict[int, Part]()
    for k in range(len(top.names)):
        having = [
            (one, match[k]) for one, match in zip(explanations, matches, strict=True) if k in match
        ]
        part = _component(having, cosine, probability)
        if part is not None:
            parts[k] = part
    certain = sorted(parts.values(), key=lambda part: -round(part.posterior, DIGITS))
    taken = [{match[k] for k in parts if k in match} for match in matches]
    return Statement(tuple(certain), _open(explanations, taken) if parts else tuple(explanations))


def _match(top: Explanation, one: Explanation, cosine: Cosine) -> dict[int, int]:
    """Match the effects of two explanations: place in the first -> place in the other."""
    if one.is_noise:
        return {}
    alike = [
        [1.0 if a.members == b.members else cosine(a.name, b.name) for b in one.causes]
        for a in top.causes
    ]
    count = len(one.names)
    # Places beyond those of the explanation stand for nothing.
    orders = permutations(range(max(count, len(top.names))), len(top.names))

    def sum_of(order: Sequence[int]) -> float:
        return sum(alike[k][i] for k, i in enumerate(order) if i < count)

    best = max(orders, key=sum_of)
    return {k: i for k, i in enumerate(best) if i < count and alike[k][i] >= RULES.rival}


def _component(
    having: Sequence[tuple[Explanation, int]], cosine: Cosine, probability: float
) -> Part | None:
    """What explanations have in common, each at a place; None if that is not certain."""
    names: dict[str, float] = defaultdict(float)
    causes: dict[str, Cause] = {}
    for one, place in having:
        cause = one.causes[place]
        names[cause.name] += one.posterior
        causes[cause.name] = cause
    total = sum(names.values())
    if round(total, DIGITS) < round(probability, DIGITS):
        return None
    held: list[str] = []
    for name in sorted(names, key=lambda name: -round(names[name], DIGITS)):
        held.append(name)
        if sum(names[one] for one in held) >= probability:
            break
    purity = min((cosine(*pair) for pair in combinations(held, 2)), default=None)
    if purity is not None and purity < RULES.rival:
        return None
    return Part(
        family=family_of(*(each for name in held for each in causes[name].members)),
        names=tuple(replace(causes[name], posterior=names[name]) for name in held),
        posterior=total,
        purity=purity,
    )


def _open(
    explanations: Sequence[Explanation], taken: Sequence[Collection[int]]
) -> tuple[Explanation, ...]:
    """What explanations have beside some of their places, most probable first; empty if nothing."""
    rest: dict[Names, Explanation] = {}
    for one, places in zip(explanations, taken, strict=True):
        certain = {one.names[i] for i in places}
        left = tuple(cause for cause in one.causes if cause.name not in certain)
        names = tuple(cause.name for cause in left)
        p = one.posterior + (rest[names].posterior if names in rest else 0.0)
        rest[names] = replace(one, causes=left, posterior=p)
    return tuple(sorted(rest.values(), key=lambda one: -one.posterior)) if any(rest) else ()

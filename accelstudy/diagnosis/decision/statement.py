"""What explanations say as a whole: what is certain, what is open, and the verdict on a problem.

Explanations of near rivals share the posterior, so that each has little of it. Together they may
leave no doubt that a slow change in time is missing, say, and with it an even nonlinearity, while
none of the four pairs that could be meant has 0.4. So the statement is made of components: each
effect of the most probable explanation, with whatever stands in its place in the others. A
component is certain if the explanations that have it hold 0.9, and its names are alike; its names
are a credible set of their own, as those of Wang et al. (2020, J. R. Stat. Soc. B 82, 1273).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import combinations, permutations, product
from typing import Any, NamedTuple, TypeAlias

from accelstudy.campaign.gross_errors.recognition import GROSS_ERRORS
from accelstudy.diagnosis.decision.posterior import Explanation, Posterior
from accelstudy.diagnosis.evidence.candidates import UNKNOWN, Cause
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.shapes import Place
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
    cosine = cache(cosine)
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
    total, causes = 0.0, dict[str, Cause]()
    for one, place in having:
        cause = one.causes[place]
        known = causes[cause.name].posterior if cause.name in causes else 0.0
        causes[cause.name] = replace(cause, posterior=known + one.posterior)
        total += one.posterior
    if round(total, DIGITS) < round(probability, DIGITS):
        return None
    held: list[Cause] = []
    for cause in sorted(causes.values(), key=lambda cause: -round(cause.posterior, DIGITS)):
        held.append(cause)
        if sum(one.posterior for one in held) >= probability:
            break
    pairs = combinations([cause.name for cause in held], 2)
    purity = min((cosine(*pair) for pair in pairs), default=None)
    if purity is not None and purity < RULES.rival:
        return None
    family = family_of(*(name for cause in held for name in cause.members))
    return Part(family, tuple(held), total, purity)


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


# --- the verdict --------------------------------------------------------------------------------


class Reason(NamedTuple):
    """Why a verdict is what it is; empty where it needs no reason.

    Attributes
    ----------
    code : str
    facts : mapping, names and numbers of the sentence for it, which `report/words.txt.j2` has
    """

    code: str = ""
    facts: Mapping[str, Any] = {}

    @classmethod
    def of(cls, code: str, **facts: Any) -> Reason:
        """Reason with its names and numbers."""
        return cls(code, facts)


@dataclass(frozen=True)
class Finding:
    """Answer to a problem: the verdict, its reason, and the causes and the fit that it rests on.

    Attributes
    ----------
    verdict : str, "no_effect", "named", "narrowed", "learned", "gross_error", "noise_model" or
        "unknown"
    frame : SessionFit, of the fit with what was chosen, or of the base fit
    reason : Reason
    chosen : tuple of Cause; of the unknown, what is certain
    posterior : Posterior, empty where nothing is missing
    statement : Statement, what is missing whatever else is open, and what may be beside that
    place : Place or None, coordinate and target of a learned function, which is the first chosen
    """

    verdict: str
    frame: SessionFit
    reason: Reason = field(default=Reason())
    chosen: tuple[Cause, ...] = ()
    posterior: Posterior = field(default=Posterior())
    statement: Statement = field(default=Statement())
    place: Place | None = None

    @property
    def alternatives(self) -> tuple[Explanation, ...]:
        """Explanations any of which would be what was chosen."""
        if self.verdict != "unknown":
            return self.posterior.credible_set
        added = {cause.members for cause in self.chosen}
        parts = [part for part in self.statement.certain if part.names[0].members in added]
        alternatives = product(*(part.names for part in parts))
        return tuple(Explanation(one, posterior=parts[0].posterior) for one in alternatives)

"""What a credible set says as a whole: what is certain, and what is open.

Explanations of near rivals share the posterior, so that each has little of it. Together they may
leave no doubt that a slow change in time is missing, say, and with it an even nonlinearity, while
none of the four pairs that could be meant has 0.4. What rivals have in common is their family in
the catalogue, such as drifts and jumps of the bias.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

from accelstudy.campaign.gross_errors import get_gross_error, gross_error_names
from accelstudy.diagnosis.decision.posterior import Explanation
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.examined import ExaminedFit
from accelstudy.diagnosis.space.hypotheses import cosines
from accelstudy.effects import effect_names, get_effect
from accelstudy.noise_effects import get_noise_effect, noise_effect_names

Names = tuple[str, ...]

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
    return get_gross_error(name).family if name in gross_error_names() else ""


@dataclass(frozen=True)
class Name:
    """A name that something missing may have.

    Attributes
    ----------
    name : str
    members : tuple of str, the names that mean the same in this campaign, itself included
    posterior : float, that what is missing is this
    """

    name: str
    members: Names
    posterior: float


@dataclass(frozen=True)
class Part:
    """One thing that is missing for certain, by the names that it may have.

    Attributes
    ----------
    family : str, what its names have in common in plain words; "" if they have nothing
    names : tuple of Name, most probable first
    posterior : float, that it is one of these
    """

    family: str
    names: tuple[Name, ...]
    posterior: float

    @property
    def is_effect(self) -> bool:
        """Whether it is an effect or a gross error: no noise, and nothing unknown."""
        return self.family != "noise" and self.names[0].name != UNKNOWN


@dataclass(frozen=True)
class Statement:
    """What is known of what is missing.

    Attributes
    ----------
    certain : tuple of Part, most probable first
    open : tuple of Explanation, what may be missing beside them, most probable first; one without
        names stands for nothing. Empty if nothing is beside them
    """

    certain: tuple[Part, ...]
    open: tuple[Explanation, ...]


def statement(
    explanations: Sequence[Explanation], probability: float = RULES.credible
) -> Statement:
    """Say what explanations leave no doubt of, and what they leave open.

    A name is certain if the explanations that have it hold enough together. A family is certain if
    those that have one of its effects do. Of a credible set, which does not hold all explanations,
    these probabilities are lower bounds.

    Parameters
    ----------
    explanations : Explanations that exclude each other
    probability : float, that is enough to be certain
    """
    left, certain = list(explanations), []
    while (part := _certain(left, probability)) is not None:
        certain.append(part)
        left = [_without(one, [name.name for name in part.names]) for one in left]
    return Statement(tuple(certain), beside(explanations, certain))


def beside(explanations: Sequence[Explanation], parts: Iterable[Part]) -> tuple[Explanation, ...]:
    """What explanations have beside some parts, most probable first; empty if they have nothing."""
    left = list(explanations)
    for part in parts:
        left = [_without(one, [name.name for name in part.names]) for one in left]
    rest: dict[Names, Explanation] = {}
    for one in left:
        same = rest.get(one.names)
        p = one.posterior + (0.0 if same is None else same.posterior)
        rest[one.names] = replace(one, posterior=p)
    return tuple(sorted(rest.values(), key=lambda one: -one.posterior)) if any(rest) else ()


def _certain(explanations: Sequence[Explanation], probability: float) -> Part | None:
    """The most specific thing that is certain: a name or, if none is, a family."""
    members: dict[str, Names] = {}
    names: dict[str, float] = defaultdict(float)
    families: dict[str, float] = defaultdict(float)
    for one in explanations:
        members.update(zip(one.names, one.classes, strict=True))
        for name in dict.fromkeys(one.names):
            names[name] += one.posterior
        for common in dict.fromkeys(family_of(*alike) for alike in one.classes):
            families[common] += one.posterior
    families.pop("", None)
    if (surest := _surest(names, probability)) is not None:
        chosen, p = [surest], names[surest]
    elif (kind := _surest(families, probability)) is not None:
        chosen = [name for name, alike in members.items() if family_of(*alike) == kind]
        chosen, p = sorted(chosen, key=lambda name: -names[name]), families[kind]
    else:
        return None
    return Part(
        family=family_of(*members[chosen[0]]),
        names=tuple(Name(name, members[name], names[name]) for name in chosen),
        posterior=p,
    )


def _surest(posteriors: Mapping[str, float], probability: float) -> str | None:
    """Most probable key, if it is certain; of equal ones the first."""
    if not posteriors:
        return None
    most = max(posteriors, key=lambda key: round(posteriors[key], DIGITS))
    return most if round(posteriors[most], DIGITS) >= round(probability, DIGITS) else None


def _without(explanation: Explanation, names: Sequence[str]) -> Explanation:
    """Take the first of some names out of an explanation."""
    first = next((name for name in names if name in explanation.names), None)
    kept = [i for i, name in enumerate(explanation.names) if name != first]
    return replace(
        explanation,
        names=tuple(explanation.names[i] for i in kept),
        classes=tuple(explanation.classes[i] for i in kept),
    )


def purity(part: Part, examined: ExaminedFit) -> float | None:
    """Smallest canonical cosine of two of the names of a part; None if it has one name.

    It tells whether they are rivals, or what happened to be left over. Of two effects it is that of
    the shapes that are most alike, and 0 of what is no effect.
    """

    def cosine(one: str, other: str) -> float:
        shapes = [examined.candidates.get(name, ()) for name in (one, other)]
        return max((float(cosines(a.ideal, b.ideal)[0]) for a, b in product(*shapes)), default=0.0)

    pairs = combinations([name.name for name in part.names], 2)
    return min((cosine(*pair) for pair in pairs), default=None)


def effects_and_others(
    explanations: Sequence[Explanation],
) -> tuple[list[Explanation], list[Explanation]]:
    """Explanations by effects alone, and the others."""
    catalogue = {*effect_names()}
    parts: tuple[list[Explanation], list[Explanation]] = [], []
    for one in explanations:
        parts[not catalogue.issuperset(one.names)].append(one)
    return parts

"""What is missing from a model in plain words: what is certain first, then what is open."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from accelstudy.basics.wording import comma_list, probability, words
from accelstudy.diagnosis.decision.explanations import CREDIBLE, Explanation
from accelstudy.diagnosis.decision.priors import MANY, SURE
from accelstudy.diagnosis.report.words.families import family_of
from accelstudy.diagnosis.report.words.statement import Name, Part, Statement, statement
from accelstudy.diagnosis.worth.next_positions import NextPosition
from accelstudy.effects import effect_names

FAMILIES = {
    "alignment of the axes": "a misalignment of the axes",
    "attitude of the rig": "an error in the attitude of the rig",
    "gross error": "a bumped position",
    "linear scale": "an error of the linear scale",
    "noise": "noise of another kind",
    "temperature": "an effect of temperature",
}
"""What is missing, by family; other families get an article."""

WORTH = 0.1
"""Posterior from which on something open is worth a word; the figure has all of it."""
NOT_AN_EFFECT = {"unknown": "something that is not in the catalogue"}
"""Words for names that stand for no effect."""


def name_words(name: str) -> str:
    """Return a name of an explanation as words."""
    return NOT_AN_EFFECT.get(name, words(name))


def family_words(family: str) -> str:
    """Return a family as what is missing: a slow change in time."""
    article = "an" if family[0] in "aeiou" else "a"
    return FAMILIES.get(family, f"{article} {family}")


def explanation_words(explanation: Explanation) -> str:
    """Return an explanation as words: bias drift with quadratic scale."""
    return " with ".join(map(name_words, explanation.names))


def missing(credible_set: Sequence[Explanation]) -> str:
    """Say what is missing: a slow change in time (bias drift or warm up) and hysteresis."""
    effects, others = _apart(credible_set)
    unless = _or([one for one in others if one.posterior >= WORTH])
    return _missing(_if_it_is_an_effect(effects)) + f", unless it is {unless}" * bool(unless)


def without_a_name(credible_set: Sequence[Explanation]) -> str:
    """Say in a sentence what is certain of something that has no name as a whole."""
    known = statement(credible_set)
    said = comma_list([_part(part) for part in known.certain if _is_effect(part)])
    if not said:
        return "Something is missing from the model, and it has no name here."
    if refuted(credible_set):
        return f"What is missing from the model is much like {said}, and yet it has no name here."
    if _surely_more(known, CREDIBLE):
        return f"The model lacks {said}; what is missing beside it has no name here."
    return f"The model lacks {said}; whether more is missing, and what, is open."


def refuted(credible_set: Sequence[Explanation]) -> bool:
    """Whether a set would have been an answer if no test had refuted it.

    Added to the model, it left a misfit, say. It may imitate what is missing; nothing is certain.
    """
    effects, _ = _apart(credible_set)
    named = any(one.posterior >= SURE for one in effects)
    narrowed = len(credible_set) <= MANY and sum(one.posterior for one in effects) >= SURE
    return named or narrowed


def most_probable(credible_set: Sequence[Explanation]) -> str:
    """Say what something without a name is most like, by families; nothing if that is open.

    If something is certain, it is said of what is beside it.
    """
    known = statement(credible_set)
    certain = bool(known.certain) and not refuted(credible_set)
    kinds: dict[str, float] = defaultdict(float)
    for one in known.open if certain else credible_set:
        named = zip(one.names, one.classes, strict=True)
        for kind in dict.fromkeys(_kind(name, members) for name, members in named):
            kinds[kind] += one.posterior
    worth = sorted(((k, p) for k, p in kinds.items() if p >= WORTH), key=lambda item: -item[1])
    return f"Most probable{' beside it' if certain else ''}: {_listed(worth)}." if worth else ""


def _kind(name: str, members: tuple[str, ...]) -> str:
    family = family_of(*members)
    return family_words(family) if family else name_words(name)


def not_told_apart(credible_set: Sequence[Explanation]) -> str:
    """Say what a campaign cannot tell apart; nothing if it tells everything apart."""
    effects, others = _apart(credible_set)
    known = _if_it_is_an_effect(effects)
    alike = [
        [(_names([name]), name.posterior) for name in part.names]
        for part in known.certain
        if len(part.names) > 1
    ]
    beside = known.open if alike or not others else credible_set
    more = [(explanation_words(o), o.posterior) for o in beside if o.names and o.posterior >= WORTH]
    perhaps = any(not one.names for one in beside)
    if len(more) > 1 and not perhaps:
        alike.append(more)
    said = [f"{', nor '.join(map(_listed, alike))} apart"] if alike else []
    if more and perhaps:
        said.append(f"whether {_listed(more, 'or')} is missing as well")
    return f"This campaign cannot tell {', nor '.join(said)}" if said else ""


def _listed(alternatives: Sequence[tuple[str, float]], last: str = "and") -> str:
    return comma_list([f"{what} ({probability(p)})" for what, p in alternatives], last)


def question(positions: Sequence[NextPosition]) -> str:
    """Say what further positions would show of the two most probable explanations, if any would."""
    if not positions:
        return ""
    first, second = (" with ".join(map(name_words, names)) for names in positions[0].separates)
    if first and second:
        return f"whether {first} or {second} is missing"
    return f"whether {first or second} is missing as well"


def _missing(known: Statement) -> str:
    if not known.certain:
        return _or(known.open)
    more = _or([one for one in known.open if one.names and one.posterior >= WORTH])
    if not more and len(known.certain) == 1:
        return _part(known.certain[0], "{family}: {names}")
    said = comma_list([_part(part) for part in known.certain])
    if not more:
        return said
    surely = _surely_more(known, CREDIBLE * sum(one.posterior for one in known.open))
    return f"{said}, and {more}" if surely else f"{said}, and perhaps {more}"


def _part(part: Part, pattern: str = "{family} ({names})") -> str:
    """Say one thing that is certain, with all names that it may have."""
    names = _names(part.names)
    if len(part.names) == 1:
        return names
    return pattern.format(family=family_words(part.family), names=names)


def _names(names: Sequence[Name]) -> str:
    """All names, with those that mean the same."""
    said = [other for name in names for other in (name.name, *name.members)]
    return comma_list(list(dict.fromkeys(map(name_words, said))), "or")


def _or(explanations: Sequence[Explanation]) -> str:
    said = [explanation_words(one) for one in explanations]
    pairs = any(len(one.names) > 1 for one in explanations)
    return ", or ".join(said) if pairs else comma_list(said, "or")


def _apart(explanations: Sequence[Explanation]) -> tuple[list[Explanation], list[Explanation]]:
    """Explanations by effects alone, and the others."""
    known = effect_names()
    effects = [one for one in explanations if all(name in known for name in one.names)]
    return effects, [one for one in explanations if one not in effects]


def _if_it_is_an_effect(effects: Sequence[Explanation]) -> Statement:
    """What is certain given that it is one of these explanations."""
    return statement(effects, probability=CREDIBLE * sum(one.posterior for one in effects))


def _surely_more(known: Statement, probability: float) -> bool:
    """Whether something is missing beside what is certain."""
    return sum(one.posterior for one in known.open if one.names) >= probability


def _is_effect(part: Part) -> bool:
    return part.family != "noise" and part.names[0].name not in NOT_AN_EFFECT

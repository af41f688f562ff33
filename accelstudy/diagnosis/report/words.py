"""A diagnosis in plain words: what is certain first, then what is open.

The sentences stand in `words.txt.j2`; here are the phrases of which it makes them, as `w`.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Sequence

from accelstudy.basics.levels import ACCEPTED, UNCHECKED
from accelstudy.basics.units import GON
from accelstudy.basics.wording import comma_list, probability, words, words_with_counts
from accelstudy.diagnosis.coordinates import TARGETS, coordinate_of
from accelstudy.diagnosis.decision.posterior import Explanation
from accelstudy.diagnosis.decision.statement import (
    Cosine,
    Part,
    Statement,
    family_of,
    statement_of,
)
from accelstudy.diagnosis.decision.verdict import Reason
from accelstudy.diagnosis.evidence.candidates import Cause
from accelstudy.diagnosis.formulas import OTHER_FORM
from accelstudy.diagnosis.result import Diagnosis, NamedCause
from accelstudy.diagnosis.rules import RULES
from accelstudy.effects import Effect, get_effect
from accelstudy.effects.learned import LEARNED, Learned
from accelstudy.leveling.error import MAX_TILT_GON
from accelstudy.pages import render_lines
from accelstudy.sensors.plausibility import USUAL_CAUSE  # noqa: F401 (of the template)

TEMPLATE = "diagnosis/report/words.txt.j2"
MAX_TILT = MAX_TILT_GON * GON
"""rad, up to which tilt errors are compared."""

FAMILIES = {
    "": "an effect",
    "alignment of the axes": "a misalignment of the axes",
    "attitude of the rig": "an error in the attitude of the rig",
    "gross error": "a bumped position",
    "linear scale": "an error of the linear scale",
    "noise": "noise of another kind",
    "temperature": "an effect of temperature",
}
"""What is missing, by family; other families get an article."""
NOT_AN_EFFECT = {"unknown": "something that is not in the catalogue"}
"""Words for names that stand for no effect."""

MIN_SAID = 0.1
"""Posterior from which on something open is worth a word; the figure has all of it."""
MIN_PLACE_SAID = 0.5
"""Posterior from which on it is worth a word where that which has a name lives."""
MAX_FORMULAS = 3
"""Formulas that are worth a word; the page lists all."""

HERE = sys.modules[__name__]


def render(part: str, *content: object) -> list[str]:
    """Say a part of the template, one sentence a line."""
    return render_lines(TEMPLATE, part, *content, w=HERE)


def verdict_lines(diagnosis: Diagnosis) -> list[str]:
    """Say in a few sentences what was found; the first is the verdict."""
    return render("verdict", diagnosis)


def advice(diagnosis: Diagnosis) -> list[str]:
    """Say what would show more, apart from further positions."""
    return render("advice", diagnosis)


def warnings(diagnosis: Diagnosis, axes: Sequence[float]) -> list[str]:
    """Say what a user of the calibration has to know; `axes` are their sigmas where they differ."""
    return render("warnings", diagnosis, axes)


def reason(diagnosis: Diagnosis) -> str:
    """Say why the verdict is what it is; nothing where that needs no reason."""
    return "; ".join(clauses(diagnosis.reason))


def clauses(of: Reason | None) -> list[str]:
    """Clauses of a reason; none where there is none."""
    return [] if of is None else render("reason", of)


def sentence(text: str) -> str:
    """Make a sentence of a clause."""
    return f"{text[:1].upper()}{text[1:]}" + ("" if text.endswith(".") else ".")


def badge(diagnosis: Diagnosis) -> str:
    """Name the badge of a page: the verdict or, where there is none, the state of a calibration."""
    if diagnosis.code == "weak":
        return ACCEPTED
    return UNCHECKED if too_few(diagnosis) else diagnosis.verdict


def too_few(diagnosis: Diagnosis) -> bool:
    """Whether nothing was found since nothing could be tested."""
    return diagnosis.verdict == "no_effect" and not diagnosis.detection.p_family


def noise_only(diagnosis: Diagnosis) -> float:
    """Probability that only the noise is wrong, and that nothing unrecorded makes it so."""
    return (diagnosis.found[0].posterior or 0.0) - diagnosis.p_coloured


def may_be_an_effect(diagnosis: Diagnosis) -> bool:
    """Whether a test of the noise fails, and yet it is not sure that only the noise is wrong."""
    return diagnosis.verdict == "noise_model" and noise_only(diagnosis) < RULES.sure


def name_text(named: NamedCause) -> str:
    """Name what was found; a learned function by its coordinate."""
    if named.name != LEARNED:
        return words(named.name)
    effect = effect_of(named)
    assert isinstance(effect, Learned)
    return f"the function of {coordinate_of(effect.coordinate).words}"


def effect_of(named: NamedCause) -> Effect:
    """Effect that was found."""
    return get_effect(named.spec)


def title(named: NamedCause, titled: set[str] | None = None) -> str:
    """Name what was found, with all that would be the same and has no title, or its position."""
    if named.position is not None:
        return f"{words(named.name)} {named.position}"
    same = [words(n) for n in named.equivalence_class if n not in (titled or {named.name})]
    return " or ".join([name_text(named), *same])


def titles(diagnosis: Diagnosis) -> str:
    """Name all that the verdict is about: effects beside a gross error are not its names."""
    gross = diagnosis.verdict == "gross_error"
    found = [named for named in diagnosis.found if not (gross and named.parameters)]
    return comma_list([title(named, {each.name for each in found}) for named in found])


def change_text(diagnosis: Diagnosis) -> str:
    """Say how the final fit differs: with what was added, and without what was left out."""
    added = [name_text(named) for named in diagnosis.found if named.parameters]
    out = [str(named.position) for named in diagnosis.found if named.position is not None]
    parts = {"with ": added, "without position ": out}
    return comma_list([start + comma_list(names) for start, names in parts.items() if names])


# --- a function without a name ------------------------------------------------------------------


def like_text(diagnosis: Diagnosis) -> str:
    """Say of what that which is missing may be a function; nothing where that is open."""
    worth = [one for one in diagnosis.like if one.posterior >= MIN_SAID]
    if diagnosis.shape is not None and len(worth) == 1:
        return ""
    named = diagnosis.verdict not in ("unknown", LEARNED)
    if named and worth and worth[0].posterior < MIN_PLACE_SAID:
        return ""  # the figure has all of it
    places = [
        (
            f"{TARGETS[one.target].alone} that varies with {place_text(one.coordinate)}",
            one.posterior,
        )
        for one in worth
    ]
    return _with_probabilities(places, "or")


def place_text(coordinate: str) -> str:
    """Say a coordinate without regard to the axes."""
    of = coordinate_of(coordinate)
    return of.place or of.words


def formulas(diagnosis: Diagnosis) -> str:
    """Say which formulas a learned function may be; nothing if none was learned."""
    if diagnosis.shape is None:
        return ""
    ranked = diagnosis.shape.ranking.formulas
    if ranked[0].text == OTHER_FORM and ranked[0].posterior >= RULES.sure:
        return f"No formula of the library describes it ({probability(ranked[0].posterior)})."
    worth = [(one.text, one.posterior) for one in ranked if one.posterior >= MIN_SAID]
    rest = " or otherwise" if len(worth) > MAX_FORMULAS else ""
    return f"It varies {_with_probabilities(worth[:MAX_FORMULAS], 'or')}{rest}."


def range_text(diagnosis: Diagnosis) -> str:
    """Say where a learned function is known; nothing if that is everywhere, or none was learned."""
    shape = diagnosis.shape
    if shape is None or not {"low", "high"} <= shape.effect.settings.keys():
        return ""
    of, settings = coordinate_of(shape.effect.coordinate), shape.effect.settings
    return f"{of.at(settings['low'])} to {of.at(settings['high'])}"


def more_of_it(diagnosis: Diagnosis) -> str:
    """Say where a learned function is known least; nothing where further positions are given."""
    shape = diagnosis.shape
    if shape is None or diagnosis.next_positions:
        return ""
    of = coordinate_of(shape.effect.coordinate)
    places = comma_list([of.at(place) for place in shape.least_known], "or")
    session = " in another session" if of.is_course else ""
    return f"Positions{session} where {of.words} is near {places}"


# --- sets of explanations -----------------------------------------------------------------------


def name_words(name: str) -> str:
    """Return a name of an explanation as words."""
    return NOT_AN_EFFECT.get(name, words(name))


def family_words(family: str) -> str:
    """Return a family as what is missing: a slow change in time."""
    article = "an" if family[:1] in "aeiou" else "a"
    return FAMILIES.get(family, f"{article} {family}")


def explanation_text(names: Sequence[str]) -> str:
    """Say the names of an explanation: bias drift with quadratic scale."""
    return " with ".join(words_with_counts(names, name_words))


def together(names: Sequence[str]) -> str:
    """List names, equal ones together: warm up and 2 outlier positions."""
    return comma_list(words_with_counts(names, name_words))


def explain_text(names: Sequence[str]) -> str:
    """List names with the verb that belongs to them."""
    return f"{together(names)} explain{'s' if len(names) == 1 else ''}"


def missing(credible_set: Sequence[Explanation], cosine: Cosine) -> str:
    """Say what is missing: a slow change in time (bias drift or warm up) and hysteresis."""
    effects, others = _effects_and_others(credible_set)
    unless = _or([one for one in others if one.posterior >= MIN_SAID])
    return _missing(_if_it_is_an_effect(effects, cosine)) + f", unless it is {unless}" * bool(
        unless
    )


def without_a_name(set_says: Statement, beside: str = "something else") -> str:
    """Say in a sentence what is certain of something that has no name as a whole.

    Parameters
    ----------
    set_says : Statement
    beside : str, what that which is open is called
    """
    effects = [part for part in set_says.certain if part.is_effect]
    if not effects:
        return "Something is missing from the model, and it has no name here."
    lacks = f"The model lacks {comma_list([_part(part) for part in effects])}"
    worth = [one for one in set_says.open if one.names and one.posterior >= MIN_SAID]
    more = sorted(worth, key=lambda one: not one.is_effects)
    surely = len(effects) < len(set_says.certain) or _surely_more(set_says, RULES.credible)
    if any(one.is_effects for one in more) and len(more) <= RULES.many:
        return f"{lacks}, and {'' if surely else 'perhaps '}{beside}: {_or(more)}."
    if surely:
        return f"{lacks}; what is missing beside it has no name here."
    return f"{lacks}; whether more is missing, and what, is open."


def most_probable(set_says: Statement, credible_set: Sequence[Explanation]) -> str:
    """Say what something without a name is most like, by families; nothing if that is open.

    If something is certain, it is said of what is beside it.
    """
    certain = any(part.is_effect for part in set_says.certain)
    kinds: dict[str, float] = defaultdict(float)
    for one in set_says.open if certain else credible_set:
        for kind in dict.fromkeys(map(_kind, one.causes)):
            kinds[kind] += one.posterior
    worth = sorted(((k, p) for k, p in kinds.items() if p >= MIN_SAID), key=lambda item: -item[1])
    if not worth:
        return ""
    return f"Most probable{' beside it' if certain else ''}: {_with_probabilities(worth)}."


def stands_for(diagnosis: Diagnosis) -> list[str]:
    """Say of each certain family which of its members the model has."""
    d, said = diagnosis, []
    for part in d.finding.statement.certain if d.verdict == "unknown" else ():
        added = [f.name for f in d.found if f.name in {name.name for name in part.names}]
        others = [name for name in part.names if name.name not in added]
        if added and others:
            said.append(f"In the model {words(added[0])} stands for {_names(others)} as well.")
    return said


def _kind(cause: Cause) -> str:
    family = family_of(*cause.members)
    return family_words(family) if family else name_words(cause.name)


def not_told_apart(credible_set: Sequence[Explanation], cosine: Cosine) -> str:
    """Say what a campaign cannot tell apart; nothing if it tells everything apart."""
    effects, others = _effects_and_others(credible_set)
    set_says = _if_it_is_an_effect(effects, cosine)
    alike = [
        [(_names([name]), name.posterior) for name in part.names]
        for part in set_says.certain
        if len(part.names) > 1
    ]
    beside = set_says.open if alike or not others else credible_set
    more = [
        (explanation_text(o.names), o.posterior)
        for o in beside
        if o.names and o.posterior >= MIN_SAID
    ]
    perhaps = any(not one.names for one in beside)
    if len(more) > 1 and not perhaps:
        alike.append(more)
    open_questions = [f"{', nor '.join(map(_with_probabilities, alike))} apart"] if alike else []
    if more and perhaps:
        open_questions.append(f"whether {_with_probabilities(more, 'or')} is missing as well")
    return f"This campaign cannot tell {', nor '.join(open_questions)}" if open_questions else ""


def _with_probabilities(alternatives: Sequence[tuple[str, float]], last: str = "and") -> str:
    return comma_list([f"{what} ({probability(p)})" for what, p in alternatives], last)


def _missing(set_says: Statement) -> str:
    if not set_says.certain:
        return _or(set_says.open)
    more = _or([one for one in set_says.open if one.names and one.posterior >= MIN_SAID])
    if not more and len(set_says.certain) == 1:
        (part,) = set_says.certain
        return _part(part, "{family}: {names}" if part.family else "{names}")
    parts = comma_list([_part(part) for part in set_says.certain])
    if not more:
        return parts
    surely = _surely_more(set_says, RULES.credible * sum(one.posterior for one in set_says.open))
    return f"{parts}, and {more}" if surely else f"{parts}, and perhaps {more}"


def _part(part: Part, pattern: str = "{family} ({names})") -> str:
    """Say one thing that is certain, with all names that it may have."""
    names = _names(part.names)
    if len(part.names) == 1:
        return names
    return pattern.format(family=family_words(part.family), names=names)


def _names(names: Sequence[Cause]) -> str:
    """All names, with those that mean the same."""
    same = [other for name in names for other in (name.name, *name.members)]
    return comma_list(list(dict.fromkeys(map(name_words, same))), "or")


def _or(explanations: Sequence[Explanation]) -> str:
    alternatives = [explanation_text(one.names) for one in explanations]
    pairs = any(len(one.names) > 1 for one in explanations)
    return ", or ".join(alternatives) if pairs else comma_list(alternatives, "or")


def _effects_and_others(
    credible_set: Sequence[Explanation],
) -> tuple[list[Explanation], list[Explanation]]:
    """Explanations by effects alone, and the others."""
    effects = [one for one in credible_set if one.is_effects]
    return effects, [one for one in credible_set if not one.is_effects]


def _if_it_is_an_effect(effects: Sequence[Explanation], cosine: Cosine) -> Statement:
    """What is certain given that it is one of these explanations."""
    probability = RULES.credible * sum(one.posterior for one in effects)
    return statement_of(effects, cosine, probability)


def _surely_more(set_says: Statement, probability: float) -> bool:
    """Whether something is missing beside what is certain."""
    return sum(one.posterior for one in set_says.open if one.names) >= probability

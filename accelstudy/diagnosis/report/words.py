"""A diagnosis in plain words: what is certain first, then what is open."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence

from accelstudy.basics.levels import ACCEPTED, UNCHECKED
from accelstudy.basics.units import display_unit
from accelstudy.basics.wording import amount, comma_list, grouped, probability, words
from accelstudy.diagnosis.decision.posterior import CREDIBLE, Explanation, of_effects
from accelstudy.diagnosis.decision.priors import MANY, SURE
from accelstudy.diagnosis.decision.statement import (
    Name,
    Part,
    Statement,
    effects_and_others,
    family_of,
    statement,
)
from accelstudy.diagnosis.decision.verdict import Named
from accelstudy.diagnosis.forms import coordinate_of
from accelstudy.diagnosis.formulas import OTHER
from accelstudy.diagnosis.next_positions import NextPosition
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.effects import effect_names, get_effect
from accelstudy.effects.learned import LEARNED, Learned
from accelstudy.pages import lines
from accelstudy.sensors.plausibility import USUAL_CAUSE

TEMPLATE = "diagnosis/report/words.txt.j2"

COORDINATES = {
    "dT/dt": "the rate of the temperature",
    "force": "the force",
    "previous": "the force in the position before",
    "next": "the step to the next position",
    "angle": "roll and pitch",
    "yaw": "the yaw",
    "move": "the last move of the robot",
}
"""Coordinates of a function without a name; others are called as they are."""
TARGETS = {
    "bias": "a bias",
    "scale": "a scale",
    "reading": "an error of the robot's readings",
    "tilt": "a tilt of the base",
}
"""What may be such a function."""


def called(name: str, spec: str) -> str:
    """Name what was found; a learned function by its coordinate."""
    if name != LEARNED:
        return words(name)
    effect = get_effect(spec)
    assert isinstance(effect, Learned)
    return f"the function of {coordinate_of(effect.coordinate).words}"


def too_few(diagnosis: Diagnosis) -> bool:
    """Whether nothing was found since nothing could be tested."""
    return diagnosis.verdict == "no_effect" and not diagnosis.screening.p_family


def headline(diagnosis: Diagnosis) -> str:
    """Say the verdict in one sentence."""
    d, kind = diagnosis, diagnosis.verdict
    if d.unrecorded or d.weak:
        return sentence(d.reason.split("; ")[0])
    if kind == "unknown":
        return without_a_name(Statement(d.certain, d.open), _beside(d))
    if kind == "narrowed":
        names = missing(d.credible_set)
    elif d.shape is not None:
        named = [*(words(f.name) for f in d.found[1:]), "something that has no name here"]
        names = f"{comma_list(named)}: {d.shape.ranking.subject}"
    else:
        # Effects beside a gross error are not its names.
        found = [f for f in d.found if kind != "gross_error" or not _is_effect(f)]
        names = comma_list([_title(f, {named.name for named in found}) for f in found])
    if too_few(d):
        kind = "too few"
    elif may_be_an_effect(d):
        kind = "noise or effect"
    return lines(TEMPLATE, "headline", kind, names)[0]


def badge(diagnosis: Diagnosis) -> str:
    """Name the badge of a page: the verdict or, where there is none, the state of a calibration."""
    if diagnosis.weak:
        return ACCEPTED
    return UNCHECKED if too_few(diagnosis) else diagnosis.verdict


def may_be_an_effect(diagnosis: Diagnosis) -> bool:
    """Whether a test of the noise fails, and yet it is not sure that only the noise is wrong."""
    return diagnosis.verdict == "noise_model" and _noise_only(diagnosis) < SURE


def _noise_only(diagnosis: Diagnosis) -> float:
    """Probability that only the noise is wrong, and that nothing unrecorded makes it so."""
    return (diagnosis.found[0].posterior or 0.0) - diagnosis.coloured


def _reasons(diagnosis: Diagnosis) -> list[str]:
    """Clauses of the reason that the headline does not say."""
    d = diagnosis
    if d.unrecorded or d.weak:
        return d.reason.split("; ")[1:]
    return [d.reason] if d.reason else []


def _title(named: Named, titled: set[str]) -> str:
    """Name what was found, with all that would be the same, or with its position."""
    if named.position is not None:
        return f"{words(named.name)} {named.position}"
    same = [words(name) for name in named.equivalence_class if name not in titled]
    return " or ".join([called(named.name, named.spec), *same])


def verdict_lines(diagnosis: Diagnosis) -> list[str]:
    """Say in a few sentences what was found; the first is the verdict."""
    d = diagnosis
    bumped = [named.position for named in d.found if named.position is not None]
    told = {
        "headline": headline(d),
        "not_told_apart": not_told_apart(d.credible_set),
        "explanation": explanation_words(d.credible_set[0]) if d.credible_set else "",
        "reasons": [sentence(part) for part in _reasons(d)],
        "noise_only": _noise_only(d) if may_be_an_effect(d) and not d.unrecorded else None,
        "usual_cause": USUAL_CAUSE,
        "residuals_over_noise": _residuals_over_noise(d),
        "weights": _weights(d),
        "suspects": {label: p for label, p in sorted(d.suspects) if label not in bumped},
        "most_probable": most_probable(Statement(d.certain, d.open), d.credible_set),
        "like": like(d),
        "stands_for": stands_for(d),
        "formulas": formulas(d),
        "beyond": beyond(d),
        "effects": [
            (f, effect.equation, effect.is_course)
            for f in d.found
            if _is_effect(f) and f.name != LEARNED
            for effect in [get_effect(f.spec)]
        ],
        "positions": bumped,
        "changed": changed(d),
        "keep_base": keep_base(d),
        "confirmation": confirmation(d) if judged(d) else "",
    }
    return lines(TEMPLATE, "verdict", d, told)


def advice(diagnosis: Diagnosis) -> list[str]:
    """Say what would show more, apart from further positions."""
    d = diagnosis
    hidden = [name for name in d.invisible if name != "gravity_error"]
    may_repeat = not d.repeated and (d.verdict == "noise_model" or not d.sigma_known)
    # What is slow and not told apart; where it is, the reason says what to record.
    by_heat = d.coloured >= WORTH and not d.unrecorded and d.campaign.temperature is None
    unseen = [] if d.approach.uses_angles else hidden
    content = (unseen, "gravity_error" in d.invisible, may_repeat, by_heat, more_of_it(d))
    return lines(TEMPLATE, "advice", *content)


def keep_base(diagnosis: Diagnosis) -> list[str]:
    """Advise the base model for leveling where what was added makes the tilt error larger."""
    if diagnosis.better_for_leveling != "base":
        return []
    return lines(TEMPLATE, "keep_base", changed(diagnosis))


def judged(diagnosis: Diagnosis) -> bool:
    """Whether effects were added that held-out positions are asked about."""
    return diagnosis.gap.held_out is not None or bool(diagnosis.gap.reason)


def confirmation(diagnosis: Diagnosis) -> str:
    """Say which statement about the added effects held on positions that were not used."""
    effects = [_title(named, {named.name}) for named in diagnosis.found if _is_effect(named)]
    learned = diagnosis.verdict == LEARNED
    return lines(TEMPLATE, "confirmation", diagnosis.gap, effects, learned)[0]


def changed(diagnosis: Diagnosis) -> str:
    """Say how the final fit differs: with what was added, and without what was left out."""
    added = [called(f.name, f.spec) for f in diagnosis.found if _is_effect(f)]
    out = [str(named.position) for named in diagnosis.found if named.position is not None]
    changes = [f"with {comma_list(added)}"] if added else []
    return comma_list([*changes, *([f"without position {comma_list(out)}"] if out else [])])


def _is_effect(named: Named) -> bool:
    return bool(named.parameters)


def _residuals_over_noise(d: Diagnosis) -> float | None:
    """Residuals of the base fit over the stated noise, if refuted and not in the reason already."""
    test = d.global_test
    if test is None or test.accepted or (d.recognised is None and d.says_the_level):
        return None
    return math.sqrt(test.statistic / test.dof)


def _weights(d: Diagnosis) -> list[float]:
    """Variances of the axes over their mean; empty if they are weighted alike."""
    if d.frame.solution is d.base:
        return []
    variances = d.frame.solution.variances[0, :3]
    return (variances / variances.mean()).tolist()


def like(diagnosis: Diagnosis) -> str:
    """Say of what that which is missing may be a function; nothing where that is open."""
    worth = [one for one in diagnosis.like if one.posterior >= WORTH]
    if diagnosis.shape is not None and len(worth) == 1:
        return ""
    named = diagnosis.verdict not in ("unknown", "learned")
    if named and worth and worth[0].posterior < PLAIN:
        return ""  # the figure has all of it
    return _listed(
        [
            (f"{TARGETS[o.target]} that varies with {COORDINATES.get(o.coordinate, o.coordinate)}",
             o.posterior)
            for o in worth
        ],
        "or",
    )  # fmt: skip


def formulas(diagnosis: Diagnosis) -> str:
    """Say which formulas a learned function may be; nothing if none was learned."""
    if diagnosis.shape is None:
        return ""
    ranked = diagnosis.shape.ranking.formulas
    if ranked[0].text == OTHER and ranked[0].posterior >= SURE:
        return f"No formula of the library describes it ({probability(ranked[0].posterior)})."
    worth = [(one.text, one.posterior) for one in ranked if one.posterior >= WORTH]
    rest = " or otherwise" if len(worth) > MOST else ""
    return f"It varies {_listed(worth[:MOST], 'or')}{rest}."


def beyond(diagnosis: Diagnosis) -> str:
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


def sentence(text: str) -> str:
    """Make a sentence of a reason, with names of the catalogue as words."""
    return f"{text[0].upper()}{words(text[1:])}" + ("" if text.endswith(".") else ".")


def described(name: str) -> str:
    """Return the first line of what the catalogue says of an effect; nothing for other names."""
    if name not in effect_names():
        return ""
    return get_effect(name).summary


def possible(spec: str) -> str:
    """Say between which bounds the parameters of an effect are; nothing if it has no bounds."""
    effect = get_effect(spec)
    if not all(map(math.isfinite, effect.bounds)):
        return ""
    unit = effect.parameters[0].unit
    low, high = (amount(bound, unit) for bound in effect.bounds)
    return f"{low} … {high} {display_unit(unit)}"


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
PLAIN = 0.5
"""Posterior from which on it is worth a word where that which has a name lives."""
MOST = 3
"""Formulas that are worth a word; the page lists all."""
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
    return " with ".join(grouped(explanation.names, name_words))


def missing(credible_set: Sequence[Explanation]) -> str:
    """Say what is missing: a slow change in time (bias drift or warm up) and hysteresis."""
    effects, others = effects_and_others(credible_set)
    unless = _or([one for one in others if one.posterior >= WORTH])
    return _missing(_if_it_is_an_effect(effects)) + f", unless it is {unless}" * bool(unless)


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
    worth = [one for one in set_says.open if one.names and one.posterior >= WORTH]
    more = sorted(worth, key=lambda one: not of_effects(one))
    surely = len(effects) < len(set_says.certain) or _surely_more(set_says, CREDIBLE)
    if any(map(of_effects, more)) and len(more) <= MANY:
        return f"{lacks}, and {'' if surely else 'perhaps '}{beside}: {_or(more)}."
    if surely:
        return f"{lacks}; what is missing beside it has no name here."
    return f"{lacks}; whether more is missing, and what, is open."


def _beside(diagnosis: Diagnosis) -> str:
    """Call what is open smaller, if what is certain takes most of the disagreement away."""
    gap, noise = diagnosis.gap, float(diagnosis.sigma_known)
    if gap.after is not None and gap.before - gap.after > 2 * (gap.after - noise):
        return "something smaller"
    return "something else"


def most_probable(set_says: Statement, credible_set: Sequence[Explanation]) -> str:
    """Say what something without a name is most like, by families; nothing if that is open.

    If something is certain, it is said of what is beside it.
    """
    certain = any(part.is_effect for part in set_says.certain)
    kinds: dict[str, float] = defaultdict(float)
    for one in set_says.open if certain else credible_set:
        named = zip(one.names, one.classes, strict=True)
        for kind in dict.fromkeys(_kind(name, members) for name, members in named):
            kinds[kind] += one.posterior
    worth = sorted(((k, p) for k, p in kinds.items() if p >= WORTH), key=lambda item: -item[1])
    return f"Most probable{' beside it' if certain else ''}: {_listed(worth)}." if worth else ""


def stands_for(diagnosis: Diagnosis) -> list[str]:
    """Say of each certain family which of its members the model has."""
    d, said = diagnosis, []
    for part in d.certain if d.verdict == "unknown" else ():
        added = [f.name for f in d.found if f.name in {name.name for name in part.names}]
        if added and len(part.names) > 1:
            others = _names([n for n in part.names if n.name not in added])
            said.append(f"In the model {words(added[0])} stands for {others} as well.")
    return said


def _kind(name: str, members: tuple[str, ...]) -> str:
    family = family_of(*members)
    return family_words(family) if family else name_words(name)


def not_told_apart(credible_set: Sequence[Explanation]) -> str:
    """Say what a campaign cannot tell apart; nothing if it tells everything apart."""
    effects, others = effects_and_others(credible_set)
    set_says = _if_it_is_an_effect(effects)
    alike = [
        [(_names([name]), name.posterior) for name in part.names]
        for part in set_says.certain
        if len(part.names) > 1
    ]
    beside = set_says.open if alike or not others else credible_set
    more = [(explanation_words(o), o.posterior) for o in beside if o.names and o.posterior >= WORTH]
    perhaps = any(not one.names for one in beside)
    if len(more) > 1 and not perhaps:
        alike.append(more)
    open_questions = [f"{', nor '.join(map(_listed, alike))} apart"] if alike else []
    if more and perhaps:
        open_questions.append(f"whether {_listed(more, 'or')} is missing as well")
    return f"This campaign cannot tell {', nor '.join(open_questions)}" if open_questions else ""


def _listed(alternatives: Sequence[tuple[str, float]], last: str = "and") -> str:
    return comma_list([f"{what} ({probability(p)})" for what, p in alternatives], last)


def question(positions: Sequence[NextPosition]) -> str:
    """Say what further positions would show, if any would."""
    if not positions:
        return ""
    if LEARNED in positions[0].separates[0]:
        return "what the learned function is like"
    first, second = (" with ".join(grouped(names, name_words)) for names in positions[0].separates)
    if first and second:
        return f"whether {first} or {second} is missing"
    return f"whether {first or second} is missing as well"


def _missing(set_says: Statement) -> str:
    if not set_says.certain:
        return _or(set_says.open)
    more = _or([one for one in set_says.open if one.names and one.posterior >= WORTH])
    if not more and len(set_says.certain) == 1:
        return _part(set_says.certain[0], "{family}: {names}")
    parts = comma_list([_part(part) for part in set_says.certain])
    if not more:
        return parts
    surely = _surely_more(set_says, CREDIBLE * sum(one.posterior for one in set_says.open))
    return f"{parts}, and {more}" if surely else f"{parts}, and perhaps {more}"


def _part(part: Part, pattern: str = "{family} ({names})") -> str:
    """Say one thing that is certain, with all names that it may have."""
    names = _names(part.names)
    if len(part.names) == 1:
        return names
    return pattern.format(family=family_words(part.family), names=names)


def _names(names: Sequence[Name]) -> str:
    """All names, with those that mean the same."""
    same = [other for name in names for other in (name.name, *name.members)]
    return comma_list(list(dict.fromkeys(map(name_words, same))), "or")


def _or(explanations: Sequence[Explanation]) -> str:
    alternatives = [explanation_words(one) for one in explanations]
    pairs = any(len(one.names) > 1 for one in explanations)
    return ", or ".join(alternatives) if pairs else comma_list(alternatives, "or")


def _if_it_is_an_effect(effects: Sequence[Explanation]) -> Statement:
    """What is certain given that it is one of these explanations."""
    return statement(effects, probability=CREDIBLE * sum(one.posterior for one in effects))


def _surely_more(set_says: Statement, probability: float) -> bool:
    """Whether something is missing beside what is certain."""
    return sum(one.posterior for one in set_says.open if one.names) >= probability

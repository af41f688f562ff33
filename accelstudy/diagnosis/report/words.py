"""A diagnosis in plain words: what is certain first, then what is open."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence

from accelstudy.basics.units import display_unit, to_display, unit_label
from accelstudy.basics.wording import comma_list, number, p_value, probability, words
from accelstudy.diagnosis.decision.posterior import CREDIBLE, Explanation
from accelstudy.diagnosis.decision.priors import SURE
from accelstudy.diagnosis.decision.statement import (
    Name,
    Part,
    Statement,
    effects_and_others,
    family_of,
    refuted,
    statement,
)
from accelstudy.diagnosis.decision.verdict import Named
from accelstudy.diagnosis.next_positions import NextPosition
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.diagnosis.space.groups import REPEAT
from accelstudy.effects import effect_names, get_effect
from accelstudy.sensors.plausibility import USUAL_CAUSE

GROUPS = {
    "direction": "with the direction of gravity",
    "robot_angles": "with the angles of the robot",
    "repeat": "between repeats of the same attitude",
    "slow_time": "slowly with time",
    "temperature": "with temperature",
    "previous_position": "with the position before",
    "single_position": "in one single position",
}
"""How a residual of each group of regressors varies."""

HEADLINES = {
    "no_effect": "Nothing that these data can show is missing from the model.",
    "named": "The model lacks {names}.",
    "narrowed": "The model lacks {names}.",
    "noise_model": "The sensor model is adequate, its noise is not: {names}.",
    "noise or effect": "No effect shows, but the residuals fail a test of the noise: {names}.",
    "gross_error": "The data have a gross error: {names}.",
}


def amount(value: float, unit: str) -> str:
    """Show an SI value in the unit that people use, without the unit."""
    return number(float(to_display(value, unit)))


def estimate(value: float, sigma: float, unit: str) -> list[str]:
    """Show an estimate and its sigma in the unit that people use, to two digits of the sigma."""
    shown, spread = float(to_display(value, unit)), float(to_display(sigma, unit))
    digits = max(0, 1 - math.floor(math.log10(spread))) if spread > 0 else 6
    return [f"{x:.{digits}f}".replace("-", "−") for x in (shown, spread)]


def shown_unit(unit: str) -> str:
    """Return the unit that people use for an SI unit, as it is printed."""
    return unit_label(display_unit(unit))


def too_few(diagnosis: Diagnosis) -> bool:
    """Whether nothing was found since nothing could be tested."""
    return diagnosis.verdict == "no_effect" and not diagnosis.screening.p_family


def headline(diagnosis: Diagnosis) -> str:
    """Say the verdict in one sentence."""
    if too_few(diagnosis):
        return "Too few positions to show whether anything is missing from the model."
    found = diagnosis.found
    if diagnosis.verdict == "narrowed":
        return HEADLINES["narrowed"].format(names=missing(diagnosis.credible_set))
    if diagnosis.verdict == "unknown":
        return without_a_name(diagnosis.credible_set)
    if diagnosis.verdict == "gross_error":
        found = tuple(f for f in found if not _is_effect(f))
    names = {named.name for named in found}
    kind = "noise or effect" if _may_be_an_effect(diagnosis) else diagnosis.verdict
    return HEADLINES[kind].format(names=comma_list([_title(f, names) for f in found]))


def _may_be_an_effect(diagnosis: Diagnosis) -> bool:
    """Whether a test of the noise fails, and yet it is not sure that only the noise is wrong."""
    if diagnosis.verdict != "noise_model":
        return False
    posterior = diagnosis.found[0].posterior
    return posterior is not None and posterior < SURE


def _title(named: Named, known: set[str]) -> str:
    """Name what was found, with all that would be the same, or with its position."""
    if named.position is not None:
        return f"{words(named.name)} {named.position}"
    same = [name for name in named.equivalence_class if name not in known]
    return " or ".join(words(name) for name in (named.name, *same))


def verdict_lines(diagnosis: Diagnosis) -> list[str]:
    """Say in a few sentences what was found; the first is the verdict."""
    d = diagnosis
    lines = [headline(d), *_narrowed(d)]
    if d.reason:
        lines.append(sentence(d.reason))
    if _may_be_an_effect(d):
        p = probability(d.found[0].posterior)
        lines.append(f"That only the noise is wrong has a probability of {p}; it may be an effect.")
    if d.recognised is not None:
        lines.append("All else is said of the data as they would be without this error.")
    if d.implausible:
        lines.append(f"No sensor is like this: {comma_list(list(d.implausible))}. {USUAL_CAUSE}")
    if d.verdict == "no_effect":
        lines.append(_agreement(d))
    else:
        lines += _refuted(d)
    lines += _weights(d)
    lines += _suspects(d)
    if d.verdict == "unknown":
        lines += [line for line in (most_probable(d.credible_set), _where(d)) if line]
    for named in filter(_is_effect, d.found):
        lines.append(_effect_line(named))
    if d.verdict == "gross_error" and any(f.position is not None for f in d.found):
        lines.append(
            "A position that disagrees with all others was moved, or the sensor had not settled. "
            f"The final parameters are those {changed(d)}."
        )
    if d.leveling is not None:
        before, after = (amount(value, "rad") for value in d.leveling)
        unit = display_unit("rad")
        lines.append(
            f"Tilt error of the calibrated sensor: {before} {unit} as it is, {after} {unit} "
            f"{changed(d)}."
        )
        lines += keep_base(d)
    if judged(d):
        lines.append(confirmation(d))
    if d.invisible:
        lines.append(
            f"This campaign cannot see {comma_list([words(n) for n in d.invisible])}, "
            "however large."
        )
    return lines


def advice(diagnosis: Diagnosis) -> list[str]:
    """Say what would show more, apart from further positions."""
    d = diagnosis
    hidden = [words(name) for name in d.invisible if name != "gravity_error"]
    lines = []
    if hidden and not d.approach.uses_angles:
        lines.append(f"The angles of a robot in each position could show {comma_list(hidden)}.")
    if "gravity_error" in d.invisible:
        lines.append("No position shows an error of g; it takes another measurement of gravity.")
    if REPEAT not in d.groups and (d.verdict == "noise_model" or not d.sigma_known):
        lines.append("Repeated attitudes would show the noise from hold to hold without any model.")
    return lines


def keep_base(diagnosis: Diagnosis) -> list[str]:
    """Advise the base model for leveling where what was added makes the tilt error larger."""
    if diagnosis.better_for_leveling != "base":
        return []
    return [
        f"For leveling keep the base model: the tilt error is larger {changed(diagnosis)}, as "
        "these positions determine what was added too weakly."
    ]


def judged(diagnosis: Diagnosis) -> bool:
    """Whether effects were added that held-out positions are asked about."""
    return diagnosis.gap.held_out is not None or bool(diagnosis.gap.reason)


def confirmation(diagnosis: Diagnosis) -> str:
    """Say which statement about the added effects held on positions that were not used."""
    gap = diagnosis.gap
    if gap.held_out is None:
        return f"Not confirmed on data that were not used: {gap.reason}."
    where = f"on {len(gap.held_out.held)} held-out positions"
    if gap.reason:  # what z would have to be was not asked then
        return f"Not confirmed {where}: {gap.reason}."
    tested = f"{where} (z = {number(gap.held_out.z)}, {number(gap.held_out.needed)} needed)"
    if not gap.confirmed:
        return f"Not confirmed {tested}."
    if gap.names:
        is_one = f"that it is {comma_list([words(name) for name in gap.names], 'or')}"
        not_which = "; not which, as each could leave what was found" * (len(gap.names) > 1)
        return f"Confirmed {tested}: {is_one}{not_which}."
    effects = [_title(named, {named.name}) for named in diagnosis.found if _is_effect(named)]
    if len(effects) > 1:
        claim = f"that such effects are missing; not that they are {comma_list(effects)}"
        return f"Confirmed {tested}: {claim} rather than rivals."
    claim = f"that such an effect is missing; not that it is {effects[0]}"
    return f"Confirmed {tested}: {claim} rather than a rival."


def changed(diagnosis: Diagnosis) -> str:
    """Say how the final fit differs: with what was added, and without what was left out."""
    added = [words(named.name) for named in diagnosis.found if _is_effect(named)]
    out = [str(named.position) for named in diagnosis.found if named.position is not None]
    changes = [f"with {comma_list(added)}"] if added else []
    return comma_list([*changes, *([f"without position {comma_list(out)}"] if out else [])])


def _is_effect(named: Named) -> bool:
    return bool(named.parameters)


def _effect_line(named: Named) -> str:
    equation = get_effect(named.spec).equation
    values = ", ".join(
        f"{name} = {' ± '.join(estimate(value, sigma or 0.0, unit))} {shown_unit(unit)}".rstrip()
        for name, value, sigma, unit in named.parameters
    )
    same = [words(name) for name in named.equivalence_class if name != named.name]
    more = [words(name) for name in named.imitators]
    alike = f" In these positions {comma_list(same)} would be the same." if same else ""
    alike += f" In these positions {comma_list(more)} could leave the same, and more." * bool(more)
    return f"{words(named.name).capitalize()}, {equation}: {values}.{alike}"


def _agreement(d: Diagnosis) -> str:
    test = d.global_test
    if d.screening.p_family:
        pattern = f"no pattern ({p_value(d.screening.p_value)})"
    else:
        pattern = f"too little redundancy ({d.base.redundancy}) to show a pattern"
    if test is None:
        return (
            "The campaign does not give its noise, so that only patterns in the residuals could be "
            f"tested, not their size; they have {pattern}."
        )
    if not test.accepted:  # the campaign is its own model
        return f"The residuals are far smaller than the stated noise, and have {pattern}."
    return (
        f"The residuals are as large as the noise says ({p_value(test.p_value)}), and have "
        f"{pattern}."
    )


def _narrowed(d: Diagnosis) -> list[str]:
    """Say what cannot be told apart, what could do it, and what all else refers to."""
    if d.verdict != "narrowed":
        return []
    not_apart = not_told_apart(d.credible_set)
    further = "; further positions would, and the report says which" if d.next_positions else ""
    taken = explanation_words(d.credible_set[0])
    return [
        f"{not_apart}{further}.",
        f"All else is said of the most probable explanation: {taken}.",
    ]


def _refuted(d: Diagnosis) -> list[str]:
    """Say by how much the stated noise is refuted, as the calibration does."""
    test = d.global_test
    in_reason = d.recognised is None and d.says_the_level
    if test is None or test.accepted or in_reason:
        return []
    ratio = math.sqrt(test.statistic / test.dof)
    much = f"{ratio:.1f} times as large as" if ratio > 1 else f"only {ratio:.2g} times"
    return [
        f"With the base model the residuals are {much} the stated noise ({p_value(test.p_value)})."
    ]


def _weights(d: Diagnosis) -> list[str]:
    """Say how unequal axes are weighted."""
    variances = d.frame.solution.variances[0, :3]
    if d.frame.solution is d.base:
        return []
    parts = comma_list([number(float(v)) for v in variances / variances.mean()])
    return [f"The axes are weighted by their noise: x, y and z have {parts} of the mean variance."]


def _suspects(d: Diagnosis) -> list[str]:
    """Say which positions a calibration marks, where the verdict is not about them."""
    bumped = {named.position for named in d.found}
    labels = [str(label) for label, _ in sorted(d.suspects) if label not in bumped]
    if not labels:
        return []
    what = f"position{'' if len(labels) == 1 else 's'} {comma_list(labels)}"
    marked = f"A calibration with the base model marks {what} as in conflict with the others"
    if d.verdict in ("no_effect", "noise_model"):
        smallest = min(p for label, p in d.suspects if label not in bumped)
        return [f"{marked} ({p_value(smallest)}); among all that is tested here it is no finding."]
    return [f"{marked}."]


def _where(d: Diagnosis) -> str:
    ranked = sorted(d.location.items(), key=lambda item: -item[1])[:3]
    shares = [
        f"{100 * share:.0f} % {GROUPS.get(name, words(name))}"
        for name, share in ranked
        if share > 0
    ]
    if not shares:
        return "Above the assumed noise level, nothing shows where it lives."
    return f"Of the excess of the residuals over the noise, {comma_list(shares)} (shares overlap)."


def sentence(text: str) -> str:
    """Make a sentence of a reason, with names of the catalogue as words."""
    return f"{text[0].upper()}{words(text[1:])}" + ("" if text.endswith(".") else ".")


def described(name: str) -> str:
    """Return the first line of what the catalogue says of an effect; nothing for other names."""
    if name not in effect_names():
        return ""
    return get_effect(name).summary


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
    effects, others = effects_and_others(credible_set)
    unless = _or([one for one in others if one.posterior >= WORTH])
    return _missing(_if_it_is_an_effect(effects)) + f", unless it is {unless}" * bool(unless)


def without_a_name(credible_set: Sequence[Explanation]) -> str:
    """Say in a sentence what is certain of something that has no name as a whole."""
    set_says = statement(credible_set)
    parts = comma_list([_part(part) for part in set_says.certain if _part_is_effect(part)])
    if not parts:
        return "Something is missing from the model, and it has no name here."
    if refuted(credible_set):
        return f"What is missing from the model is much like {parts}, and yet it has no name here."
    if _surely_more(set_says, CREDIBLE):
        return f"The model lacks {parts}; what is missing beside it has no name here."
    return f"The model lacks {parts}; whether more is missing, and what, is open."


def most_probable(credible_set: Sequence[Explanation]) -> str:
    """Say what something without a name is most like, by families; nothing if that is open.

    If something is certain, it is said of what is beside it.
    """
    set_says = statement(credible_set)
    certain = bool(set_says.certain) and not refuted(credible_set)
    kinds: dict[str, float] = defaultdict(float)
    for one in set_says.open if certain else credible_set:
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
    """Say what further positions would show of the two most probable explanations, if any would."""
    if not positions:
        return ""
    first, second = (" with ".join(map(name_words, names)) for names in positions[0].separates)
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


def _part_is_effect(part: Part) -> bool:
    return part.family != "noise" and part.names[0].name not in NOT_AN_EFFECT

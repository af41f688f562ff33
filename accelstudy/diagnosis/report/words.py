"""A diagnosis in plain words: what is certain first, then what is open.

The sentences stand in `words.txt.j2`; here are the phrases of which it makes them, as `w`.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from accelstudy.basics.levels import ACCEPTED, MAX_TILT_GON, UNCHECKED
from accelstudy.basics.units import GON, attitude_unit, shown_unit, to_attitude
from accelstudy.basics.wording import (
    amount,
    comma_list,
    number,
    probability,
    words,
    words_with_counts,
)
from accelstudy.diagnosis.decision.functions import LearnedShape
from accelstudy.diagnosis.decision.posterior import Explanation
from accelstudy.diagnosis.decision.statement import (
    Cosine,
    Part,
    Reason,
    Statement,
    statement_of,
)
from accelstudy.diagnosis.file_format import FoundEffect
from accelstudy.diagnosis.result import CampaignDiagnosis
from accelstudy.diagnosis.rules import RULES
from accelstudy.effects import Effect, get_effect
from accelstudy.effects.learned import LEARNED, WAVES, LearnedFunction
from accelstudy.pages import render_lines
from accelstudy.sensors.plausibility import USUAL_CAUSE  # noqa: F401 (of the template)

TEMPLATE = "diagnosis/report/words.txt.j2"
MAX_TILT = MAX_TILT_GON * GON
"""rad, up to which tilt errors are compared."""

FAMILIES = {
    "": "an effect",
    "alignment of the axes": "a misalignment of the axes",
    "attitude of the rig": "an error in the attitude of the rig",
    "gross error": "an outlier position",
    "linear scale": "an error of the linear scale",
    "noise": "noise of another kind",
    "temperature": "an effect of temperature",
}
"""What is missing, by family; other families get an article."""
NOT_AN_EFFECT = {"unknown": "something that is not in the catalogue"}
"""Words for names that stand for no effect."""

MIN_SAID = 0.1
"""Posterior from which on something open is worth a word; the page has all of it."""
MIN_PLACE_SAID = 0.5
"""Posterior from which on the place of what has a name is worth a word."""


def render(part: str, *content: object) -> list[str]:
    """Say a part of the template, one sentence a line."""
    return render_lines(TEMPLATE, part, *content, w=sys.modules[__name__])


def verdict_lines(diagnosis: CampaignDiagnosis) -> list[str]:
    """Say in a few sentences what was found; the first is the verdict."""
    return render("verdict", diagnosis)


def clauses(of: Reason) -> list[str]:
    """Clauses of a reason; none where it is empty."""
    return render("reason", of)


def sentence(text: str) -> str:
    """Make a sentence of a clause."""
    return f"{text[:1].upper()}{text[1:]}" + ("" if text.endswith(".") else ".")


def badge(diagnosis: CampaignDiagnosis) -> str:
    """Name the badge of a page: the verdict or, where there is none, the state of a calibration."""
    if diagnosis.reason.code == "weak":
        return ACCEPTED
    return UNCHECKED if too_few(diagnosis) else diagnosis.verdict


def too_few(diagnosis: CampaignDiagnosis) -> bool:
    """Whether nothing was found since nothing could be tested."""
    return diagnosis.verdict == "no_effect" and not diagnosis.problem.field.names


def noise_only(diagnosis: CampaignDiagnosis) -> float:
    """Probability that only the noise is wrong, and that nothing unrecorded makes it so."""
    return (diagnosis.found[0].posterior or 0.0) - diagnosis.p_coloured


def may_be_an_effect(diagnosis: CampaignDiagnosis) -> bool:
    """Whether a test of the noise fails, and yet it is not sure that only the noise is wrong."""
    return diagnosis.verdict == "noise_model" and noise_only(diagnosis) < RULES.sure


def name_text(named: FoundEffect) -> str:
    """Name what was found; a learned function by its coordinate."""
    if named.name != LEARNED:
        return words(named.name)
    effect = effect_of(named)
    assert isinstance(effect, LearnedFunction)
    return f"the function of {coordinate_of(effect.coordinate).words}"


def effect_of(named: FoundEffect) -> Effect:
    """Effect that was found."""
    return get_effect(named.spec)


def title(named: FoundEffect, titled: set[str] | None = None) -> str:
    """Name what was found, with all that would be the same and has no title, or its position."""
    if named.position is not None:
        return f"{words(named.name)} {named.position}"
    same = [words(n) for n in named.equivalence_class if n not in (titled or {named.name})]
    return " or ".join([name_text(named), *same])


def titles(diagnosis: CampaignDiagnosis) -> str:
    """Name all that the verdict is about: effects beside a gross error are not its names."""
    gross = diagnosis.verdict == "gross_error"
    found = [named for named in diagnosis.found if not (gross and named.parameters)]
    return comma_list([title(named, {each.name for each in found}) for named in found])


def change_text(diagnosis: CampaignDiagnosis) -> str:
    """Say how the final fit differs: with what was added, and without what was left out."""
    added = [name_text(named) for named in diagnosis.found if named.parameters]
    out = [str(named.position) for named in diagnosis.found if named.position is not None]
    parts = {"with ": added, "without position ": out}
    return comma_list([start + comma_list(names) for start, names in parts.items() if names])


# --- a function without a name ------------------------------------------------------------------


class Coordinate(NamedTuple):
    """How people see a coordinate.

    Attributes
    ----------
    words : str
    place : str, the same where no axis is meant
    unit : str, of its values
    size : float, SI size of that unit
    """

    words: str
    place: str
    unit: str
    size: float = 1.0

    def at(self, value: float) -> str:
        """Show a value."""
        return f"{number(value / self.size)} {self.unit}".rstrip()


def coordinate_of(name: str) -> Coordinate:
    """Describe a coordinate of a learned effect, or of a place."""
    words, place, unit, size = COORDINATES[WAVES.get(name, name)]
    if unit == "rad":
        unit, size = attitude_unit(), float(1 / to_attitude(1.0))
    return Coordinate(words, place or words, unit, size)


RATE = "the rate of the temperature", "", "K/min", 1 / 60
COORDINATES = {
    "angle": ("the angle", "roll and pitch", "rad", 1.0),
    "yaw": ("the yaw", "", "rad", 1.0),
    "move": ("the last move of the robot", "", "rad", 1.0),
    "force": ("the force along the same axis", "the force", "m/s²", 1.0),
    "previous": ("the force in the position before", "", "m/s²", 1.0),
    "next": ("the step to the next position", "", "m/s²", 1.0),
    "vibration": ("the vibration", "vibration", "m/s²", 1.0),
    "temperature": ("the temperature", "temperature", "°C", 1.0),
    "temperature rate": RATE,
    "dT/dt": RATE,
    "time": ("the time", "time", "min", 60.0),
    "order": ("the number of the position", "", "", 1.0),
}
"""Words of each coordinate, also where no axis is meant if these are others, and its unit."""
TARGETS = {
    "bias": ("bias of {}", "the bias of {}", "a bias"),
    "scale": ("scale of {}", "the scale of {}", "a scale"),
    "square": ("quadratic scale of {}", "the quadratic scale of {}", "a scale"),
    "nonorthogonality": ("non-orthogonality {}", "the non-orthogonality {}", "a non-orthogonality"),
    "mounting": ("rotation about {}", "the rotation of the sensor on its mounting about {}",
                 "a rotation of the sensor on its mounting"),
    "reading": ("reading of {}", "the robot's reading of {}", "an error of the robot's readings"),
    "tilt": ("tilt {}", "the tilt of the robot's base ({})", "a tilt of the base"),
}  # fmt: skip
"""Words of what depends on a coordinate: short and in a sentence, with a place for the components,
and in a sentence without them."""


def subject(shape: LearnedShape) -> str:
    """Say what depends on what: the bias of x and y depends on the yaw."""
    which = "all axes" if len(shape.axes) == len("xyz") else comma_list(shape.axes)
    _, what, _ = TARGETS[shape.effect.target]
    return f"{what.format(which)} depends on {coordinate_of(shape.effect.coordinate).words}"


def like_text(diagnosis: CampaignDiagnosis) -> str:
    """Say of what that which is missing may be a function; nothing where that is open."""
    worth = [one for one in diagnosis.like if one.posterior >= MIN_SAID]
    if diagnosis.shape is not None and len(worth) == 1:
        return ""
    named = diagnosis.verdict not in ("unknown", LEARNED)
    if named and worth and worth[0].posterior < MIN_PLACE_SAID:
        return ""  # the figure has all of it
    places = {
        f"{TARGETS[one.target][2]} that varies with {coordinate_of(one.coordinate).place}": (
            one.posterior
        )
        for one in worth
    }
    return _with_probabilities(places, "or")


def extents_text(shape: LearnedShape) -> str:
    """Say how far a learned function goes up and down in a session."""
    sizes = [f"{amount(size, shape.unit)} ({axis})" for axis, size in shape.extents.items()]
    return f"{comma_list(sizes)} {shown_unit(shape.unit)}".rstrip()


def range_text(diagnosis: CampaignDiagnosis) -> str:
    """Say where a learned function is known; nothing if that is everywhere, or none was learned."""
    shape = diagnosis.shape
    if shape is None or not {"low", "high"} <= shape.effect.settings.keys():
        return ""
    of, settings = coordinate_of(shape.effect.coordinate), shape.effect.settings
    return f"{of.at(settings['low'])} to {of.at(settings['high'])}"


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


def most_probable(credible_set: Sequence[Explanation]) -> str:
    """List the explanations that are worth a word, the most probable first."""
    worth = {explanation_text(one.names): one.posterior
             for one in credible_set if one.posterior >= MIN_SAID}  # fmt: skip
    return _with_probabilities(worth)


def missing(credible_set: Sequence[Explanation], cosine: Cosine) -> str:
    """Say what is missing: a slow change in time (bias drift or warm up) and hysteresis."""
    effects = [one for one in credible_set if one.is_effects]
    others = [one for one in credible_set if not one.is_effects and one.posterior >= MIN_SAID]
    # What is certain given that it is one of the effects.
    share = RULES.credible * sum(one.posterior for one in effects)
    says = statement_of(effects, cosine, share)
    text = _certain(says) or _or(effects)
    return f"{text}, unless it is {_or(others)}" if others else text


def without_a_name(says: Statement) -> str:
    """Say in a sentence what is certain of something that has no name as a whole."""
    certain = _certain(says)
    if not certain:
        return "Something is missing from the model, and it has no name here."
    if _further(says):
        return f"The model lacks {certain}."
    return f"The model lacks {certain}; what is missing beside it has no name here."


def _certain(says: Statement) -> str:
    """Say what is certain, and what may be beside it; nothing if nothing is certain."""
    parts, beside = [part for part in says.certain if part.is_effect], _further(says)
    if len(parts) == 1 and not beside:
        return _part(parts[0], "{family}: {names}" if parts[0].family else "{names}")
    text = comma_list([_part(part) for part in parts])
    if not parts or not beside:
        return text
    surely = all(one.names for one in says.open)
    return f"{text}, and {'' if surely else 'perhaps '}{_or(beside)}"


def _further(says: Statement) -> list[Explanation]:
    """What may be beside that which is certain, if these are few."""
    worth = [one for one in says.open if one.names and one.posterior >= MIN_SAID]
    return worth if len(worth) <= RULES.many else []


def _with_probabilities(alternatives: Mapping[str, float], last: str = "and") -> str:
    return comma_list([f"{what} ({probability(p)})" for what, p in alternatives.items()], last)


def _part(part: Part, pattern: str = "{family} ({names})") -> str:
    """Say one thing that is certain, with all names that it may have."""
    # Those that mean the same follow each name.
    same = [other for name in part.names for other in (name.name, *name.members)]
    names = comma_list(list(dict.fromkeys(map(name_words, same))), "or")
    if len(part.names) == 1:
        return names
    return pattern.format(family=family_words(part.family), names=names)


def _or(explanations: Sequence[Explanation]) -> str:
    alternatives = [explanation_text(one.names) for one in explanations]
    pairs = any(len(one.names) > 1 for one in explanations)
    return ", or ".join(alternatives) if pairs else comma_list(alternatives, "or")

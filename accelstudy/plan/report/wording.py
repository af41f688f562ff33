"""A plan in words: first the answer in plain sentences, then its table and reasons."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence

import numpy as np

from accelstudy.basics.units import (
    GON,
    MGON,
    angle_note,
    display_unit,
    to_display,
)
from accelstudy.basics.wording import comma_list, number, quantity_text, words
from accelstudy.effects import get_effect
from accelstudy.plan.report.advice import (
    PLAIN,
    InUse,
    Need,
    Spoiler,
    in_use,
    limits,
    needs,
    spoilers,
)
from accelstudy.plan.search.answer import OTHER_CONFIDENCE, Answer, Ranked
from accelstudy.plan.search.candidates import NINE, Candidate, shortest
from accelstudy.plan.search.optimised import is_best, request_of
from accelstudy.plan.search.question import Equipment, Question
from accelstudy.sensors.sensor import SensorModel

VERDICTS = {
    "needed": "must be in the model",
    "worth it": "worth having in the model",
    "of no use": "in the model, of little use",
    "not needed": "need not be in the model",
}


def answer_lines(answer: Answer) -> list[str]:
    """Say what to do, in sentences."""
    if not answer.ranked:
        return [unreachable(answer)]
    question, first = answer.question, answer.first
    candidate, simulated = first.candidate, first.simulated
    assert simulated is not None
    by_hand = candidate.equipment.name == "gravity"
    opening = "You need no robot. " if by_hand else "You need a robot. "
    if len(question.equipment) == 1:
        opening = ""
    share = OTHER_CONFIDENCE if question.confidence is None else question.confidence
    lines = [
        f"{opening}{effort(candidate, imperative=True)}.",
        f"Roll and pitch are then right to {_angles(simulated.rms)} (rms) at tilts up to "
        f"{quantity_text(question.tilt_range, 'rad')}; in {100 * share:g} of "
        f"100 such calibrations both stay below {_angle(simulated.of_both(share))}.",
    ]
    lines.append(_fewest(question, first))
    target = quantity_text(question.target, "rad")
    if question.confidence is None:
        wanted = (
            f"For both to stay below {target} in {100 * OTHER_CONFIDENCE:g} of 100 calibrations"
        )
    else:
        wanted = f"For {target} in the rms only"
    other = answer.stricter
    lines.append(
        f"{wanted}: {effort(other.candidate)}."
        if other is not None
        else f"{wanted}: nothing tried here would do."
    )
    others = [r for r in answer.ranked if r.candidate.equipment != candidate.equipment]
    if others:
        lines.append(f"The other way: {effort(others[0].candidate)}.")
    elif not by_hand and len(question.equipment) > 1:
        best = _most_accurate(answer, "gravity")
        if best is not None:
            leaves = _angle(best.accuracy(question.confidence))
            lines.append(f"By hand the best leaves {leaves}: {effort(best)}.")
    use = in_use(question)
    if any(size.source == "assumed" for size in question.sizes.values()):
        lines += _linear(question, candidate)
    more = [f"{_angle(use.reading)} of noise in each reading {_like(question, use)}"]
    if not math.isnan(use.drift):
        more.append(f"{_angle(use.drift)} after {use.hours:g} h")
    if not math.isnan(use.warmth):
        more.append(f"{_angle(use.warmth)} where it is {use.kelvin:g} K warmer or colder")
    lines.append(f"In use this adds: {comma_list(more)}.")
    return lines


def _fewest(question: Question, ranked: Ranked) -> str:
    """Say why no fewer positions are recommended, and how well the simulation knows that."""
    assert ranked.simulated is not None
    n = ranked.candidate.scheme.n_positions
    if ranked.fewer is None:
        return "With fewer positions an error in one of them would not be noticed."
    left = ranked.fewer.accuracy(question.confidence)
    error = ranked.simulated.uncertainty(question.confidence)
    shown = f"{_value(left)} ± {to_display(error, 'rad'):.1g} {display_unit('rad')}"
    simulated = f"{shown}, from {ranked.simulated.simulated} simulations"
    if left - 2 * error < question.target:
        return f"Whether {n - 1} would do is within the error of the simulation ({simulated})."
    return f"Fewer do not suffice: {n - 1} positions leave {simulated}."


def _linear(question: Question, candidate: Candidate) -> list[str]:
    """Say which nonlinearity would matter, if the sensor was assumed to be linear."""
    found = [s for s in spoilers(question, candidate) if s.effect == "quadratic_scale"]
    return [
        "This assumes a linear sensor; a quadratic nonlinearity of "
        f"{quantity_text(s.size, s.unit)} would by itself leave as much, unless the calibration "
        "estimates it, too."
        for s in found
    ]


def unreachable(answer: Answer) -> str:
    """Say in one line that nothing reaches the target, and what is reachable."""
    question, best = answer.question, answer.best
    within = []
    if question.most_seconds < math.inf:
        within.append(f"within {question.most_seconds / 60:g} min")
    if question.most_positions < 200:
        within.append(f"with at most {question.most_positions} positions")
    within.append({1: _equipment(question.equipment[0])}.get(len(question.equipment), ""))
    limit = " ".join(filter(None, within))
    if best is None:
        least = shortest(question)
        needed = "" if least is None else f": the shortest takes {effort(least)}"
        return f"No calibration fits {limit}{needed}."
    measure = "rms" if question.confidence is None else f"{100 * question.confidence:g} % of them"
    target = quantity_text(question.target, "rad")
    return (
        f"No calibration tried here reaches {target} ({measure}) {limit}".rstrip()
        + f"; the best leaves {_angle(best.accuracy(question.confidence))}: {effort(best)}, "
        f"limited by the {limits(question, best)}"
        + ("" if answer.instead is None else f". A robot reaches it: {effort(answer.instead)}")
        + "."
    )


def effort(candidate: Candidate, imperative: bool = False) -> str:
    """Positions and time of a candidate: ``28 positions by hand, 10 s each, about 14 minutes``."""
    n = candidate.scheme.n_positions
    how = _equipment(candidate.equipment)
    text = f"{n} positions {how}, {candidate.hold:g} s each"
    setup = candidate.equipment.setup
    extra = f", with {minutes(setup)} to set it up" if setup else ""
    link = ": about" if imperative else ", about"
    verb = "Measure " if imperative else ""
    return f"{verb}{text}{link} {minutes(candidate.seconds)}{extra}"


def minutes(seconds: float) -> str:
    """Show a time in the field."""
    if seconds < 5400:
        return f"{math.ceil(seconds / 60)} minutes"
    return f"{number(seconds / 3600)} hours"


def table_lines(answer: Answer) -> list[str]:
    """The ranked candidates as a table, and what its columns mean."""
    unit = display_unit("rad")
    head = [
        "", "equipment", "model", "scheme", "positions", "s each", "minutes",
        f"roll/{unit}", f"pitch/{unit}", f"both/{unit}", "limited by",
    ]  # fmt: skip
    rows = [head, *(_row(answer, i, r) for i, r in enumerate(answer.ranked, 1))]
    widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
    right = {4, 5, 6, 7, 8, 9}
    lines = [
        "  ".join(
            text.rjust(width) if i in right else text.ljust(width)
            for i, (text, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
    return [
        *lines,
        "model: number of parameters, and effects besides bias, scale and angles between axes;",
        "roll, pitch: rms, and interval with 95 of 100 calibrations of each angle by itself, from",
        f"{answer.replicates} simulated ones each; ~ by linear theory;",
        "both: what roll and pitch both stay below in 95 of 100 calibrations",
    ]


def _row(answer: Answer, rank: int, ranked: Ranked) -> list[str]:
    candidate = ranked.candidate
    source = ranked.simulated or candidate.expected
    about = "" if ranked.simulated else "~"
    ends = (source.quantile(0.025), source.rms, source.quantile(0.975))
    cells = [
        f"{about}{number(m)} ({number(a)} … {number(b)})"
        for a, m, b in zip(*(to_display(v, "rad") for v in ends), strict=True)
    ]
    return [
        f"{rank}.",
        _equipment(candidate.equipment),
        model_words(candidate.model),
        candidate.scheme.name.partition("@")[0],
        str(candidate.scheme.n_positions),
        f"{candidate.hold:g}",
        f"{candidate.seconds / 60:.1f}",
        *cells,
        f"{about}{number(float(to_display(source.of_both(OTHER_CONFIDENCE), 'rad')))}",
        limits(answer.question, candidate),
    ]


def model_words(model: SensorModel) -> str:
    """A model by its number of parameters and its effects besides the usual nine parameters."""
    nine = {"bias", "scale", "nonorthogonality"}
    effects = [effect.name for effect in model.effects]
    more = [words(name.removesuffix("_scale")) for name in effects if name not in nine]
    less = [] if nine <= set(effects) else ["no angles between axes"]
    short = [name.replace("cross axis misalignment", "cross-axis") for name in (*more, *less)]
    return " + ".join([str(model.n_parameters), *short])


def reason_lines(answer: Answer) -> Iterator[str]:
    """What the model of the first candidate needs, what would spoil it, and what use adds."""
    question, candidate = answer.question, answer.first.candidate
    unit_note = f"({angle_note()})"
    yield f"The calibration's model: {candidate.model.name} {unit_note}"
    for need in needs(question, candidate):
        yield f"  {_need(need)}"
    target = quantity_text(question.target, "rad")
    yield f"Effects that are not in the model, and the size that by itself would leave {target}:"
    for spoiler in spoilers(question, candidate):
        yield f"  {_spoiler(spoiler)}"
    if candidate.equipment.name == "gravity":
        yield "Gravity does not show how the sensor sits in its housing. Put it on a flat surface,"
        yield "read roll and pitch, turn it there by 180°, read again: the means are its errors."
    yield "In use, in addition to what the calibration leaves (rms of the worse angle):"
    for line in use_lines(question, in_use(question)):
        yield f"  {line}"


def _need(need: Need) -> str:
    effect = PLAIN[need.effect]
    unit = get_effect(need.effect).parameters[0].unit
    size = f"{quantity_text(need.size, unit)}, {need.source}"
    what = []
    if not math.isnan(need.left):
        remains = "would remain" if need.in_model else "remains"
        what.append(f"without it {_angle(need.left)} {remains}")
    if not math.isnan(need.cost):
        costs = "costs" if need.in_model else "would cost"
        what.append(f"estimating it {costs} {_angle(need.cost)}")
    elif not need.in_model:
        what.append("these positions do not determine it")
    return f"{effect} ({size}): {VERDICTS[need.verdict]}; {comma_list(what)}"


def _spoiler(spoiler: Spoiler) -> str:
    low, high = (quantity_text(v, spoiler.unit) for v in spoiler.usual)
    if math.isinf(spoiler.size):
        return f"{PLAIN[spoiler.effect]}: does not matter, whatever its size"
    size = quantity_text(spoiler.size, spoiler.unit)
    return f"{PLAIN[spoiler.effect]}: {size} (usual: {low} to {high}): {spoiler.verdict}"


def use_lines(question: Question, use: InUse) -> list[str]:
    """What use adds to the errors of the calibration."""
    like = _like(question, use)

    def told(value: float) -> str:
        return "not known" if math.isnan(value) else _angle(value)

    return [
        f"noise of a reading {like}: {told(use.reading)}",
        f"drift of the bias within {use.hours:g} h: {told(use.drift)}",
        f"temperature {use.kelvin:g} K off that of the calibration: {told(use.warmth)}",
        f"switched off and on again: {told(use.restart)}",
    ]


def _like(question: Question, use: InUse) -> str:
    """Duration of the reading whose noise is stated."""
    if question.sheet.position_sigma is not None:
        return "as long as a position"
    return f"of {use.seconds:g} s"


def assumption_lines(question: Question) -> list[str]:
    """Assumptions of the plan."""
    lines = [f"Sensor: {question.sheet.name}, {question.sheet.title}."]
    assumed = [PLAIN[e] for e, size in question.sizes.items() if size.source == "typical"]
    if assumed:
        lines.append(f"Assumed to have a usual size, since it is unknown: {comma_list(assumed)}.")
    if any(size.source == "assumed" for size in question.sizes.values()):
        lines.append("The sensor is assumed to be linear, since only its noise is known.")
    if question.sheet.position_sigma is not None:
        sigma = quantity_text(question.sheet.position_sigma, "m/s^2")
        lines.append(f"The mean of a position has a noise of {sigma}, however long it is held.")
    for equipment in question.equipment:
        setup = f", {equipment.setup / 60:g} minutes to set up" if equipment.setup else ""
        lines.append(
            f"Time {_equipment(equipment)}: {equipment.moving:g} s to move from position "
            f"to position{setup}."
        )
    if any(equipment.name == "robot" for equipment in question.equipment):
        lines.append(f"Robot: roll and pitch to {_angle(question.sigma_angle)}.")
    return lines


def how_to(answer: Answer) -> list[str]:
    """Say how to get the positions, and how exactly to measure them."""
    candidate = answer.first.candidate
    lines = [f"The positions: {positions_command(answer.question, candidate)}"]
    if candidate.equipment.name == "gravity":
        lines.append("By hand they need not be exact, only still: gravity itself is the reference.")
    return lines


def positions_command(question: Question, candidate: Candidate) -> str:
    """The command that shows, or finds again, the positions of a candidate."""
    if not is_best(candidate.scheme):
        return f"accelstudy scheme {shlex.quote(question.written(candidate.scheme))}"
    request = request_of(question, candidate)
    options = {
        "positions": str(request.positions),
        "approach": request.approach,
        "model": request.model,
        "criterion": request.criterion,
        "tilt-range": f"{request.tilt_range / GON:.6g}gon",
        "sigma": f"{request.noise.sigma_force:.4g}m/s2",
        "robot-sigma": f"{request.noise.sigma_angle / MGON:.6g}mgon",
        "starts": str(request.starts),
        "out": "positions.yaml",
    }
    usual = {"model": NINE, "sigma": "0.002m/s2", "robot-sigma": "3.2mgon", "approach": "robot"}
    given = (f"--{name} {text}" for name, text in options.items() if text != usual.get(name))
    return " ".join(["accelstudy design", *given])


def _equipment(equipment: Equipment) -> str:
    return {"gravity": "by hand", "robot": "with a robot"}.get(equipment.name, equipment.name)


def _most_accurate(answer: Answer, equipment: str) -> Candidate | None:
    confidence = answer.question.confidence
    mine = [c for c in answer.compared if c.equipment.name == equipment]
    return min(mine, key=lambda c: c.accuracy(confidence), default=None)


def _angle(value: float) -> str:
    return f"{_value(value)} {display_unit('rad')}"


def _value(angle: float) -> str:
    return number(float(to_display(angle, "rad")))


def _angles(values: Sequence[float] | np.ndarray) -> str:
    shown = [number(float(v)) for v in to_display(values, "rad")]
    return f"{comma_list(list(dict.fromkeys(shown)))} {display_unit('rad')}"

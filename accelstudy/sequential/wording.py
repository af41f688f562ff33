"""Advice in plain words."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.suggested import calibrate
from accelstudy.basics.units import attitude_unit, quantity_text, to_attitude
from accelstudy.basics.wording import comma_list, counted, p_value, words
from accelstudy.campaign.session import Campaign
from accelstudy.effects import Effect
from accelstudy.leveling.angles import roll_pitch
from accelstudy.sensors.frames import FRD, Frame
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sequential.advisor import Advice
from accelstudy.sequential.promise import LEAST_REDUNDANCY, Promise
from accelstudy.sequential.screening import Agreement

Array = NDArray[np.float64]

LEVEL = np.radians(0.5)
"""An axis within this of the horizon is level, one within this of the vertical straight up or
down."""


CHANGING = {"time": "times", "temperature": "temperatures", "vibration": "vibration"}
"""Conditions other than the attitude on which effects depend."""


def lines(advice: Advice, campaign: Campaign, model: SensorModel, promise: Promise) -> list[str]:
    """Write the advice, most important last."""
    return [
        *_last(advice),
        *_aside(advice),
        *_undetermined(advice, model),
        *_noise(advice),
        _accuracy(advice, promise),
        _next(advice, FRD if campaign.log is None else campaign.log.axes),
        _to_go(advice, campaign),
    ]


def heading(advice: Advice, campaign: Campaign, model: SensorModel, approach: str) -> str:
    """Heading of the advice."""
    how = "by gravity alone" if approach == "gravity" else f"with the {approach}"
    return (
        f"{campaign.name}: {counted(len(advice.positions), 'position')} so far; "
        f"{counted(model.n_parameters, 'parameter')} {how}"
    )


def attitude(direction: Array, frame: Frame = FRD) -> str:
    """Describe an attitude by roll and pitch, and by the directions of its axes.

    Parameters
    ----------
    direction : (3,) array, of gravity in frd
    frame : Frame, of the axes that a person knows
    """
    roll, pitch = frame.signs[:2] * np.array(roll_pitch(tuple(-direction)))
    if roll < -np.pi + LEVEL:  # −π and π are the same roll: show the positive one
        roll += 2 * np.pi
    upright = np.hypot(direction[1], direction[2]) < np.sin(LEVEL)
    angles = [] if upright else [f"roll {_angle(roll)}"]
    angles.append(f"pitch {_angle(pitch)}")
    down = frame.from_frd(direction)
    straight = [i for i in range(3) if abs(down[i]) > np.cos(LEVEL)]
    axes = [_axis("xyz"[i], down[i]) for i in (straight or range(3))]
    return f"{', '.join(angles)} ({', '.join(axes)})"


def _axis(name: str, down: float) -> str:
    angle = np.arcsin(np.clip(down, -1, 1))
    if abs(angle) < LEVEL:
        return f"{name} axis level"
    way = "down" if angle > 0 else "up"
    if abs(abs(angle) - np.pi / 2) < LEVEL:
        return f"{name} axis straight {way}"
    return f"{name} axis {_angle(abs(angle))} {way}"


def _angle(angle: float) -> str:
    value = round(float(to_attitude(angle)), 1) + 0.0
    return f"{value:g} {attitude_unit()}"


def _last(advice: Advice) -> list[str]:
    last = advice.last
    if last is None:
        return []
    label = f"position {advice.positions[last.index]}"
    if last.agreement is Agreement.UNTESTED:
        return [f"{label}: taken; there is nothing to test it by yet"]
    p = p_value(last.p_value)
    if last.agreement is Agreement.AGREES:
        return [f"{label}: agrees with the others ({p})"]
    if last.repeats:
        return [
            f"{label}: IN CONFLICT with the others ({p}), and so was the same attitude before: it "
            "was not bumped; one of the others is wrong, or the model lacks an effect "
            "(`accelstudy diagnose` tells)"
        ]
    return [f"{label}: IN CONFLICT with the others ({p}); it is not used, repeat it"]


def _aside(advice: Advice) -> list[str]:
    if not advice.set_aside:
        return []
    numbers = comma_list([str(number) for number in advice.set_aside])
    noun = "position" if len(advice.set_aside) == 1 else "positions"
    entries = ", ".join(f"{{position: {n}, reason: in conflict}}" for n in advice.set_aside)
    return [
        f"set aside: {noun} {numbers}; to leave out of a calibration too, add to campaign.yaml: "
        f"excluded: [{entries}]"
    ]


def _undetermined(advice: Advice, model: SensorModel) -> list[str]:
    sentences = []
    if advice.undetermined:
        sentences.append(f"not determined yet: {_by_effect(advice.undetermined, model)}")
    if advice.vague:
        sentences.append(
            f"hardly determined yet, less than by any data sheet: {_by_effect(advice.vague, model)}"
        )
    return sentences


def _by_effect(names: Sequence[str], model: SensorModel) -> str:
    """Group parameters by their effects: bias (b_x, b_y), scale."""
    parts = []
    for effect in model.effects:
        of_effect = [parameter.name for parameter in effect.parameters]
        named = [name for name in of_effect if name in names]
        if named:
            some = "" if named == of_effect else f" ({', '.join(named)})"
            parts.append(f"{words(effect.name)}{some}{_needs(effect)}")
    return comma_list(parts)


def _needs(effect: Effect) -> str:
    """What must change between positions for an effect to be seen, besides the attitude."""
    columns = compose(effect.spec, (effect.spec,)).hold_columns
    needed = [f"other {word}" for column, word in CHANGING.items() if column in columns]
    return f" [needs {comma_list(needed)}]" if needed else ""


def _noise(advice: Advice) -> list[str]:
    noise = advice.noise
    if noise.stated is not None and not noise.refuted:
        return []
    seen = None if noise.seen is None else _about(noise.seen, "m/s^2")
    if noise.refuted and noise.stated is not None:
        stated = quantity_text(noise.stated, "m/s^2")
        what = (
            f"noise of a position: {seen} by the residuals, more than the stated {stated} "
            "allows: it is understated, or the model lacks an effect"
        )
    elif seen is None:
        what = "noise of a position: not stated, and no redundancy yet that would tell it"
    else:
        what = f"noise of a position: not stated, {seen} by the residuals (r = {noise.redundancy})"
    if noise.taken is None:
        return [f"{what}; it is judged by them from r = {LEAST_REDUNDANCY} on"]
    return [f"{what}; to be safe, taken as {_about(noise.taken, 'm/s^2')}"]


def _accuracy(advice: Advice, promise: Promise) -> str:
    wanted = quantity_text(promise.accuracy, "rad")
    where = f"rms up to {quantity_text(promise.tilt_range, 'rad')} of tilt"
    if advice.rms is None:
        return f"tilt accuracy: not known yet; {wanted} in roll and in pitch is wanted ({where})"
    roll, pitch = (_about(float(value), "rad") for value in advice.rms)
    return f"tilt accuracy: roll {roll}, pitch {pitch} ({where}); {wanted} is wanted"


def _about(value: float, unit: str) -> str:
    """Write a quantity that is known to a few per cent at best."""
    number, shown = quantity_text(value, unit).split(" ")
    return f"{float(number):.3g} {shown}"


def _next(advice: Advice, frame: Frame) -> str:
    where, repeated = attitude(advice.next.direction, frame), advice.next.repeats
    if repeated is not None:
        return f"next position: position {repeated} once more, {where}"
    return f"{'further' if advice.enough else 'next'} position: {where}"


def _to_go(advice: Advice, campaign: Campaign) -> str:
    if advice.enough:
        return (
            "YOU CAN STOP: the accuracy is reached, as an rms over calibrations; a single one may "
            "leave more"
        )
    if advice.to_go is not None:
        return f"to go: about {counted(advice.to_go, 'position')}"
    if advice.noise.taken is None:
        return "to go: cannot be told before the noise is known"
    if not advice.foreseeable:
        return "to go: cannot be told, as it depends on the conditions of the positions to come"
    robot = ", or a robot," if campaign.angles is None else ""
    return f"to go: hundreds of positions; a quieter reading (a longer hold){robot} is needed"


def finished(campaign: Path, model: str, approach: str) -> str:
    """Say what to do when the accuracy is reached."""
    return f"calibrate: {calibrate(campaign, model, approach)}"

"""Reasons of a plan: what the model needs, what would spoil it, and what use adds."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.effects import get_effect
from accelstudy.planning.candidates import PLANNED_MODELS, Candidate
from accelstudy.planning.question import Question
from accelstudy.planning.theory import OF_RIG, Theory, theory_of
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

PLAIN = {
    "nonorthogonality": "angles between the axes",
    "cross_axis_misalignment": "rotation against the housing",
    "quadratic_scale": "quadratic nonlinearity",
    "cubic_scale": "cubic nonlinearity",
    "mounting_rotation": "rotation of the sensor in its mount",
    "base_tilt": "tilt of the robot's base",
    "encoder_scale": "scale error of the robot's angles",
    "encoder_offset": "zero error of the robot's angles",
    "gravity_error": "wrong value of gravity",
}
"""Effects in plain words."""


@dataclass(frozen=True)
class Need:
    """Whether an effect of the sensor must be in the model.

    Attributes
    ----------
    effect : str
    size : float, SI
    unit : str, SI
    source : str, where the size comes from
    in_model : bool
    left : float, rad, rms that neglecting the effect adds; NaN if the positions cannot show it
    cost : float, rad, rms that noise adds if the effect is estimated; NaN if it cannot be
    verdict : "needed", "worth it", "of no use" or "not needed"
    """

    effect: str
    size: float
    unit: str
    source: str
    in_model: bool
    left: float
    cost: float
    verdict: str

    @property
    def title(self) -> str:
        """The effect in plain words."""
        return PLAIN[self.effect]


@dataclass(frozen=True)
class Spoiler:
    """Size of an effect that would by itself use up the target.

    Attributes
    ----------
    effect : str
    unit : str, SI
    size : float, SI; inf if no size of it matters
    usual : (float, float), SI, sizes of good and of cheap equipment
    verdict : "spoils it", "may spoil it" or "does not matter"
    """

    effect: str
    unit: str
    size: float
    usual: tuple[float, float]
    verdict: str

    @property
    def title(self) -> str:
        """The effect in plain words."""
        return PLAIN[self.effect]


@dataclass(frozen=True)
class InUse:
    """What adds to a calibration's tilt error when the sensor is used; sds of roll or pitch, rad.

    Attributes
    ----------
    reading : float, by the noise of one reading; NaN if that is not known
    seconds : float, s, duration of the reading
    drift : float, by the drift of the bias since the calibration; NaN if that is not known
    hours : float, h, since the calibration
    warmth : float, by bias and scale at another temperature; NaN if neither is known
    kelvin : float, K, difference in temperature
    restart : float, by the bias after switching off and on; NaN if that is not known
    """

    reading: float
    seconds: float
    drift: float
    hours: float
    warmth: float
    kelvin: float
    restart: float


def limits(question: Question, candidate: Candidate) -> str:
    """What limits the accuracy of a candidate, in a few words."""
    expected = candidate.expected
    worse = int(np.argmax(expected.rms))
    total = float(expected.rms[worse] ** 2)
    parts = {
        f"neglected {PLAIN[name]}": float(square[worse]) / total
        for name, square in expected.neglected.items()
    }
    noise = float(expected.noise[worse]) / total
    if candidate.equipment.name == "robot":
        quiet = _noise_square(question, candidate, sigma_angle=1e-12)[worse] / total
        parts["noise of the robot's angles"] = noise - float(quiet)
        noise = float(quiet)
    sheet = question.sheet
    if sheet.velocity_random_walk is not None:
        white = sheet.velocity_random_walk**2 / candidate.hold / candidate.sigma**2
        parts["wander of the sensor's bias"] = noise * max(0.0, 1 - white)
        noise *= min(1.0, white)
    parts["noise of the sensor"] = noise
    return max(parts, key=lambda name: parts[name])


def needs(question: Question, candidate: Candidate) -> list[Need]:
    """Say for each effect of the sensor whether the model needs it to reach the target."""
    theory = theory_of(question.tilt_range)
    rows = _rows(question, theory, candidate)
    effects = [effect.name for effect in candidate.model.effects]
    judged = []
    for effect, size in question.sizes.items():
        if size.value == 0:
            continue
        unit = get_effect(effect).parameters[0].unit
        inside = effect in effects
        without = _model_with(effects, effect, False)
        including = _model_with(effects, effect, True)
        alone = theory.expected(rows, without, question.neglectable)
        more = theory.expected(rows, including, question.neglectable)
        left = cost = math.nan
        if alone is not None:
            left = float(np.sqrt(alone.neglected[effect].max()))
        if more is not None:
            quieter = np.zeros(2) if alone is None else alone.noise
            cost = float(np.sqrt(np.maximum(more.noise - quieter, 0.0).max()))
        if inside:
            fails = alone is None or not replace(candidate, expected=alone).reaches(
                question.target, question.confidence
            )
            verdict = "needed" if fails else "worth it" if left > cost else "of no use"
        else:
            verdict = "worth it" if left > cost else "not needed"
        judged.append(Need(effect, size.value, unit, size.source, inside, left, cost, verdict))
    return judged


def spoilers(question: Question, candidate: Candidate) -> list[Spoiler]:
    """Sizes at which effects that are not in the model would by themselves use up the target."""
    theory = theory_of(question.tilt_range)
    rows = _rows(question, theory, candidate)
    inside = {effect.name for effect in candidate.model.effects}
    effects = [e for e in ("quadratic_scale", "cubic_scale") if e not in inside]
    if candidate.equipment.name == "robot":
        # Without a robot the mounting of the sensor neither shows nor does harm.
        effects += [] if "cross_axis_misalignment" in inside else ["mounting_rotation"]
        effects += OF_RIG
    else:
        effects.append("gravity_error")
    sizes = []
    for name in effects:
        effect = get_effect(name)
        each = float(theory.neglecting(rows, candidate.model, name).max())
        # An effect without influence leaves rounding errors only.
        size = math.inf if each < 1e-6 else question.target / each
        low, high = effect.typical
        verdict = "spoils it"
        if size > low:
            verdict = "may spoil it" if size <= high else "does not matter"
        unit = effect.parameters[0].unit
        sizes.append(Spoiler(name, unit, size, (low, high), verdict))
    return sizes


def in_use(
    question: Question, seconds: float = 1.0, hours: float = 8.0, kelvin: float = 10.0
) -> InUse:
    """Tilt errors in use that add to that of the calibration."""
    sheet = question.sheet
    theory = theory_of(question.tilt_range)

    def tilt(**sigmas: float) -> float:
        """Rms of the worse angle that independent errors of each axis leave; by effect, SI."""
        variance = np.zeros(len(theory.quadratic[0]))
        for effect, sigma in sigmas.items():
            variance[theory.columns[effect]] = sigma**2
        return float(np.sqrt(np.einsum("auu,u->a", theory.quadratic, variance).max()))

    drift = warmth = restart = math.nan
    changes = (sheet.bias_instability, sheet.acceleration_random_walk, sheet.bias_rate)
    if any(change is not None for change in changes):
        drift = tilt(bias=sheet.bias_change(hours * 3600))
    if sheet.bias_per_kelvin is not None or sheet.scale_per_kelvin is not None:
        bias, scale = sheet.warmed(kelvin)
        warmth = tilt(bias=bias, scale=scale)
    if sheet.repeatability is not None:
        restart = tilt(bias=sheet.bias_change(0.0, restarted=True))
    reading = tilt(bias=sheet.sigma_mean(seconds))
    return InUse(reading, seconds, drift, hours, warmth, kelvin, restart)


def _rows(question: Question, theory: Theory, candidate: Candidate) -> Array:
    noise = Noise(candidate.sigma, question.sigma_angle)
    return theory.rows(candidate.scheme.directions, candidate.equipment.name, noise)


def _noise_square(question: Question, candidate: Candidate, sigma_angle: float) -> Array:
    """Mean square error that noise leaves, (2,), rad², with another noise of the robot."""
    theory = theory_of(question.tilt_range)
    noise = Noise(candidate.sigma, sigma_angle)
    rows = theory.rows(candidate.scheme.directions, candidate.equipment.name, noise)
    expected = theory.expected(rows, candidate.model, {})
    return np.zeros(2) if expected is None else expected.noise


def _model_with(effects: list[str], effect: str, inside: bool) -> SensorModel:
    """Model of these effects, with or without one of them."""
    kept = [name for name in effects if name != effect] + ([effect] if inside else [])
    for name in PLANNED_MODELS:
        model = get_model(name)
        if {e.name for e in model.effects} == set(kept):
            return model
    return get_model("+".join(kept))

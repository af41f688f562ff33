"""Reasons of a plan: what limits it, what would spoil it, and what use adds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from accelstudy.basics.wording import words
from accelstudy.effects import Effect, get_effect
from accelstudy.leveling.distribution import NOISE, Tilt
from accelstudy.planning.candidates import (
    OF_RIG,
    Candidate,
    error_up_to,
    every_effect,
    information_of,
    tilt_of,
)
from accelstudy.planning.question import NONLINEAR, Question

READING, HOURS, KELVIN = 1.0, 8.0, 10.0
"""Use: s of a reading, h since the calibration, and K off its temperature."""


@dataclass(frozen=True)
class Spoiler:
    """Size of an effect that would by itself use up the target.

    Attributes
    ----------
    effect : Effect
    size : float, SI; inf if no size of it matters
    verdict : "spoils it", "may spoil it" or "does not matter"
    """

    effect: Effect
    size: float
    verdict: str


def limits(question: Question, candidate: Candidate) -> str:
    """What limits the accuracy of a candidate, in a few words."""
    worse = int(np.argmax(candidate.tilt.rms))
    parts = {cause: each[worse] for cause, each in candidate.tilt.squares.items()}
    noise = parts.pop(NOISE)
    by_words = {f"neglected {words(effect)}": square for effect, square in parts.items()}
    if candidate.equipment.name == "robot":
        quiet = _tilt(replace(question, sigma_angle=1e-12), candidate, {})
        robot = noise - quiet.squares[NOISE][worse]
        by_words["noise of the robot's angles"], noise = robot, noise - robot
    walk = question.sheet.velocity_random_walk
    if walk is not None:
        white = min(1.0, walk**2 / candidate.hold / candidate.sigma**2)
        by_words["wander of the sensor's bias"], noise = noise * (1 - white), noise * white
    by_words["noise of the sensor"] = noise
    return max(by_words, key=by_words.__getitem__)


def spoilers(question: Question, candidate: Candidate) -> list[Spoiler]:
    """Sizes at which effects that are not in the model would by themselves use up the target."""
    inside = candidate.model.effect_names
    effects = [e for e in NONLINEAR if e not in inside]
    if candidate.equipment.name == "robot":
        # Without a robot the mounting of the sensor neither shows nor does harm.
        effects += [] if "cross_axis_misalignment" in inside else ["mounting_rotation"]
        effects += OF_RIG
    else:
        effects.append("gravity_error")
    squares = _tilt(question, candidate, dict.fromkeys(effects, 1.0)).squares
    sizes = []
    for effect in map(get_effect, effects):
        each = float(np.sqrt(squares[effect.name].max()))
        # An effect without influence leaves rounding errors only.
        size = math.inf if each < 1e-6 else question.target / each
        low, high = effect.typical
        verdict = "spoils it"
        if size > low:
            verdict = "may spoil it" if size <= high else "does not matter"
        sizes.append(Spoiler(effect, size, verdict))
    return sizes


def _tilt(question: Question, candidate: Candidate, sizes: Mapping[str, float]) -> Tilt:
    """Tilt error in the positions of a candidate beside effects of other sizes."""
    at = candidate.scheme.directions, candidate.sigma
    information = information_of(question, candidate.equipment, *at)
    tilt = tilt_of(question, information, candidate.model, sizes)
    assert tilt is not None
    return tilt


def errors_in_use(question: Question, kelvin: float = KELVIN) -> dict[str, float]:
    """Tilt errors in use that add to that of the calibration, rms of the worse angle, rad.

    By the noise of a reading of `READING`, by the drift of the bias within `HOURS` since the
    calibration, by bias and scale at another temperature, and by switching off and on. NaN where
    the data sheet tells nothing of it.
    """
    sheet = question.sheet
    quadratic, columns = error_up_to(question.tilt_range).quadratic, every_effect()[1]

    def tilt(known: bool = True, **sigmas: float) -> float:
        """What independent errors of each axis leave; by effect, SI."""
        variance = np.zeros(len(quadratic[0]))
        for effect, sigma in sigmas.items():
            variance[columns[effect]] = sigma**2
        left = float(np.sqrt(np.einsum("auu,u->a", quadratic, variance).max()))
        return left if known else math.nan

    changes = (sheet.bias_instability, sheet.acceleration_random_walk, sheet.bias_rate)
    warm = (sheet.bias_per_kelvin, sheet.scale_per_kelvin)
    bias, scale = sheet.temperature_sigmas(kelvin)
    restart = sheet.repeatability is not None
    return {
        "reading": tilt(bias=sheet.sigma_mean(READING)),
        "drift": tilt(any(c is not None for c in changes), bias=sheet.bias_change(HOURS * 3600)),
        "warmth": tilt(any(c is not None for c in warm), bias=bias, scale=scale),
        "restart": tilt(restart, bias=sheet.bias_change(0.0, restarted=True)),
    }

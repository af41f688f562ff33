"""Bounds of parameters and of tilt errors, beyond which there must be a gross error.

A fit has no bounds: a scale of −2 fits an axis with the wrong sign perfectly.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.units import STANDARD_GRAVITY, display_unit
from accelstudy.basics.wording import amount
from accelstudy.effects import Effect, get_effect

MAX_FACTOR = 20.0
"""Multiple of the typical size of cheap equipment beyond which a parameter is implausible."""
MIN_SIGMAS = 3.0
"""Standard deviations by which an estimate must be beyond its bound."""
LARGEST = {
    "bias": 0.3 * STANDARD_GRAVITY,
    "scale": 0.2,
    "base_tilt": 0.1,
    "encoder_offset": 0.1,
}
"""Effects with a bound of their own, SI. Data sheets of cheap digital sensors allow a bias of
0.25 g and a scale error of 10 % (Analog Devices ADXL345), and public measurements have up to 0.13 g
and 4 %. What is clearly beyond both comes from a wrong unit, range, offset or sign. The tilt of a
rig and the zeros of its circles depend on its set-up, not on its quality."""
USUAL_CAUSE = (
    "The usual cause is a wrong scale, offset, unit or gravity of the import, or a wrong sign, "
    "axis or row."
)
"""What to check if no sensor can have some parameters."""


def largest(effect: Effect) -> float:
    """Largest plausible size of a parameter of an effect, SI; infinite if nothing is known.

    It is `MAX_FACTOR` times the size that the catalogue calls typical of cheap equipment.
    """
    if effect.name in LARGEST:
        return LARGEST[effect.name]
    if isinstance(type(effect).typical, property):  # not stated: a default
        return np.inf
    return MAX_FACTOR * float(effect.typical[1])


def largest_tilt() -> float:
    """Tilt error, rad, that a cheap sensor has without any calibration."""
    return float(get_effect("bias").typical[1]) / STANDARD_GRAVITY


def implausible_parameters(effects: Sequence[Effect], parameters: Array, sigma: Array) -> list[str]:
    """Describe each parameter that no sensor can have: its size, and what would be plausible.

    So does each that is beyond the bounds that physics sets. A large estimate that the positions
    hardly determine says nothing of the sensor, so it counts only if it is beyond the bound by
    `MIN_SIGMAS` of its standard deviations.

    Parameters
    ----------
    effects : sequence of Effect, of the model
    parameters, sigma : (u,) arrays, SI, in the order of the effects; an unknown sigma (NaN)
        counts as 0
    """
    usual = [(-bound, bound) for bound in map(largest, effects)]
    values = np.nan_to_num(parameters, nan=np.inf)
    return [
        *impossible_parameters(effects, parameters, sigma),
        *_beyond(effects, usual, values, sigma, "plausible up to ± {1}"),
    ]


def impossible_parameters(effects: Sequence[Effect], parameters: Array, sigma: Array) -> list[str]:
    """Describe each parameter that is clearly beyond its physical bounds.

    Parameters
    ----------
    effects, parameters, sigma : as of `implausible_parameters`
    """
    bounds = [effect.bounds for effect in effects]
    return _beyond(effects, bounds, parameters, sigma, "{0} … {1} is possible")


def _beyond(
    effects: Sequence[Effect],
    bounds: Sequence[tuple[float, float]],
    parameters: Array,
    sigma: Array,
    right: str,
) -> list[str]:
    """Describe each parameter beyond the bounds of its effect; `right` says what they allow."""
    values = iter(zip(parameters, MIN_SIGMAS * np.nan_to_num(sigma, posinf=0.0), strict=True))
    descriptions = []
    for effect, (low, high) in zip(effects, bounds, strict=True):
        for parameter in effect.parameters:
            value, uncertain = next(values)
            if value < low - uncertain or value > high + uncertain:
                shown, *ends = (amount(float(v), parameter.unit) for v in (value, low, high))
                text = f"{parameter.name} = {shown} {display_unit(parameter.unit)}"
                descriptions.append(f"{text} ({right.format(*ends)})")
    return descriptions


def implausible_tilt(roll: float, pitch: float) -> list[str]:
    """Describe a tilt error, rad, that makes a calibration useless; empty for any other."""
    if not np.fmax(roll, pitch) > largest_tilt():
        return []
    worst, most = (amount(error, "rad") for error in (np.fmax(roll, pitch), largest_tilt()))
    return [
        f"a tilt error of {worst} {display_unit('rad')} is left, where a cheap "
        f"sensor without any calibration has {most}"
    ]

"""What a sensor can have, and what can only be a gross error: bounds of parameters and of tilt.

A fit knows no bounds: an axis with the wrong sign is fitted perfectly by a scale of −2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.units import STANDARD_GRAVITY, display_unit, to_display
from accelstudy.basics.wording import number
from accelstudy.effects import Effect, get_effect

Array = NDArray[np.float64]

FACTOR = 20.0
"""Times the typical size of cheap equipment, beyond which a parameter is not believed."""
CLEARLY = 3.0
"""Standard deviations by which an estimate must be beyond its bound."""
LARGEST = {"scale": 0.5, "base_tilt": 0.1, "encoder_offset": 0.1}
"""Effects with a bound of their own, SI. Beyond a half, a scale is a unit, a range or a sign; how a
rig stands and where its circles begin is up to who set it up, not to its quality."""


def largest(effect: Effect) -> float:
    """Largest size of a parameter of an effect that is believed, SI; infinite if nothing is known.

    It is `FACTOR` times the size that the catalogue calls typical of cheap equipment.
    """
    if effect.name in LARGEST:
        return LARGEST[effect.name]
    if isinstance(type(effect).typical, property):  # not stated, but by default
        return np.inf
    return FACTOR * float(effect.typical[1])


def largest_tilt() -> float:
    """Tilt error, rad, from which on a calibration is useless: a cheap sensor has it without."""
    return float(get_effect("bias").typical[1]) / STANDARD_GRAVITY


def implausible_parameters(effects: Sequence[Effect], parameters: Array, sigma: Array) -> list[str]:
    """Say of each parameter that no sensor has how large it is, and what would be believed.

    A large estimate that the positions hardly determine says nothing of the sensor, so it counts
    only if it is beyond the bound by `CLEARLY` of its standard deviations.

    Parameters
    ----------
    effects : sequence of Effect, of the model
    parameters, sigma : (u,) arrays, SI, in the order of the effects; a sigma that is unknown (NaN)
        excuses nothing
    """
    doubt = CLEARLY * np.nan_to_num(np.asarray(sigma, dtype=float), posinf=0.0)
    values = iter(zip(np.asarray(parameters, dtype=float), doubt, strict=True))
    found = []
    for effect in effects:
        bound = largest(effect)
        for parameter in effect.parameters:
            value, uncertain = next(values)
            if not abs(value) <= bound + uncertain:
                shown, most = (number(float(to_display(v, parameter.unit))) for v in (value, bound))
                unit = display_unit(parameter.unit)
                found.append(f"{parameter.name} = {shown} {unit} (up to ± {most} is believed)")
    return found


def implausible_tilt(roll: float, pitch: float) -> list[str]:
    """Say that a tilt error is useless, rad; nothing of one that is not, or is not known."""
    if not np.fmax(roll, pitch) > largest_tilt():
        return []
    worst, most = to_display([np.fmax(roll, pitch), largest_tilt()], "rad")
    return [
        f"a tilt error of {number(float(worst))} {display_unit('rad')} is left, where a cheap "
        f"sensor without any calibration has {number(float(most))}"
    ]

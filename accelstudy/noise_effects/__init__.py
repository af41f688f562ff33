"""Ways in which noise is not white, not Gaussian, or not of the stated sigma.

To add one, write a module next to this file with a class under `register`.
"""

from accelstudy.basics.registry import import_modules
from accelstudy.noise_effects.base import (
    NoiseEffect,
    get_noise_effect,
    noise_effect_names,
    register,
)

__all__ = ["NoiseEffect", "get_noise_effect", "noise_effect_names", "register"]

# A module registers its noise effects when it is imported.
import_modules(__name__, __path__)

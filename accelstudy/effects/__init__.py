"""The effects of which sensor models are composed, one small file each.

An effect is defined once, by how it shows in the sensor's output or in the robot's angles.
Simulation, adjustment, sensitivity analysis and diagnosis evaluate or differentiate that one
definition. To add one, write a module next to this file with a class under `register`.
"""

from accelstudy.basics.registry import Setting, import_modules
from accelstudy.effects.base import (
    Effect,
    Parameter,
    effect_names,
    effects_without,
    get_effect,
    is_effect,
    register,
)
from accelstudy.effects.hold_conditions import HoldConditions
from accelstudy.effects.lag import TemperatureCourse, course_of_log

__all__ = [
    "Effect",
    "HoldConditions",
    "Parameter",
    "Setting",
    "TemperatureCourse",
    "course_of_log",
    "effect_names",
    "effects_without",
    "get_effect",
    "is_effect",
    "register",
]

# A module registers its effects when it is imported.
import_modules(__name__, __path__)

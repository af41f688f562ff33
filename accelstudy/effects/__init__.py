"""The effects of which sensor models are composed, one small file each.

An effect is defined once, by how it shows in the sensor's output or in the robot's angles.
Simulation, adjustment, sensitivity analysis and diagnosis evaluate or differentiate that one
definition. A new effect is one file with one class in it, registered by the decorator and imported
below.
"""

from accelstudy.effects.base import Effect, Hold, Parameter, effect_names, get_effect, register
from accelstudy.effects.bias import Bias
from accelstudy.effects.cross_axis_misalignment import CrossAxisMisalignment
from accelstudy.effects.cubic_scale import CubicScale
from accelstudy.effects.nonorthogonality import NonOrthogonality
from accelstudy.effects.quadratic_scale import QuadraticScale
from accelstudy.effects.scale import Scale

__all__ = [
    "Bias",
    "CrossAxisMisalignment",
    "CubicScale",
    "Effect",
    "Hold",
    "NonOrthogonality",
    "Parameter",
    "QuadraticScale",
    "Scale",
    "effect_names",
    "get_effect",
    "register",
]

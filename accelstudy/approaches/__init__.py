"""Calibration approaches: which condition equations an attitude contributes.

To add one, write a module next to this file with a class under `register`.
"""

from accelstudy.approaches.base import Approach, approach_names, get_approach, register
from accelstudy.basics.registry import import_modules

__all__ = ["Approach", "approach_names", "get_approach", "register"]

# A module registers its approaches when it is imported.
import_modules(__name__, __path__)

"""Calibration approaches: which condition equations an attitude contributes, one file each."""

from accelstudy.approaches.base import Approach, approach_names, get_approach, register
from accelstudy.approaches.gravity import Gravity
from accelstudy.approaches.robot import Robot

__all__ = ["Approach", "Gravity", "Robot", "approach_names", "get_approach", "register"]

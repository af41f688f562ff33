"""Gauss–Helmert adjustment, in general and for the calibration of an accelerometer."""

from accelstudy.adjustment.calibration import calibrate
from accelstudy.adjustment.equations import CalibrationEquations
from accelstudy.adjustment.gauss_helmert import (
    Adjustment,
    ConditionEquations,
    Linearisation,
    adjust,
)
from accelstudy.adjustment.observations import Observations

__all__ = [
    "Adjustment",
    "CalibrationEquations",
    "ConditionEquations",
    "Linearisation",
    "Observations",
    "adjust",
    "calibrate",
]

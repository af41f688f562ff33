"""Gauss–Helmert adjustment, in general and for the calibration of an accelerometer."""

from accelstudy.adjustment.calibration import (
    CalibrationEquations,
    Observations,
    calibrate,
    whitened_jacobian,
)
from accelstudy.adjustment.gauss_helmert import (
    Adjustment,
    ConditionEquations,
    FunctionConditions,
    Linearisation,
    adjust,
)

__all__ = [
    "Adjustment",
    "CalibrationEquations",
    "ConditionEquations",
    "FunctionConditions",
    "Linearisation",
    "Observations",
    "adjust",
    "calibrate",
    "whitened_jacobian",
]

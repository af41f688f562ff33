"""The format of `calibration.json`: its keys, what they mean, and what is checked of them."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, model_validator

from accelstudy.basics import bounds
from accelstudy.basics.bounds import Range
from accelstudy.campaign.header import ANY, Exclusion, LogLayout, Nominal, PerAxis
from accelstudy.files.documents import Document, Part
from accelstudy.files.validation import Gravity, ParameterSigma, ParameterValue, bounds_of
from accelstudy.sensors.models import compose

Array = NDArray[np.float64]

REDUNDANCY, VARIANCE = Range(0, 10**9), Range(-1e18, 1e18)
LEAST_VARIANCE = 1e-40
"""SI, variance below that of any estimate."""
LEAST_REGULAR = 1e12
"""Condition of a matrix beyond which it has no inverse."""
CORRELATION_TOLERANCE = 1e-6
"""Numerical tolerance of the checks of a correlation matrix."""

Matrix = list[list[float | None]]


def _regular(matrix: list[list[float]]) -> list[list[float]]:
    if np.linalg.cond(np.array(matrix)) > LEAST_REGULAR:
        raise ValueError("must be a matrix that has an inverse")
    return matrix


def _check_ends(ends: list[float]) -> list[float]:
    if ends[0] > ends[1]:
        raise ValueError("must be the smallest and the largest value, in this order")
    return ends


Triple = Annotated[list[ParameterValue], PerAxis]
Regular = Annotated[list[Triple], PerAxis, AfterValidator(_regular)]
Ends = Annotated[
    list[Annotated[float, *bounds_of(ANY)]],
    Field(min_length=2, max_length=2),
    AfterValidator(_check_ends),
]


class Shown(Part):
    """The same as people read it."""

    value: float | None
    """estimate"""
    sigma: float | None
    """its standard deviation"""
    unit: str
    """unit, such as ppm or mgon"""


class Parameter(Part):
    """A parameter."""

    name: str
    """name"""
    value: ParameterValue
    """estimate"""
    sigma: ParameterSigma | None
    """its standard deviation, as quoted"""
    ci95: float | None = None
    """half of its 95 % confidence interval"""
    sigma_priori: float | None = None
    """by the stated noise"""
    sigma_posteriori: float | None = None
    """by the residuals"""
    unit: str
    """SI unit"""
    shown: Shown | None = None


class Reference(Part):
    """The sensor that gave the angles."""

    calibration: str
    """campaign of its calibration"""
    frame: str
    """where its axes point in the axes of the sensor"""
    sigma_mps2: float
    """standard deviation of its mean in a hold, per axis"""


class Type(Part):
    """The type of the sensor that was used as prior."""

    file: str
    """its file"""
    sensors: int
    """number of sensors that it is estimated from"""


class Affine(Part):
    """The calibration as a matrix; null where the model is not linear in the force."""

    matrix: Matrix
    """K of f = K (reading − b)"""
    bias_mps2: list[float | None]
    """b of the same"""


class Correction(Part):
    """A gross error that a diagnosis corrected."""

    error: str
    """its name with its settings"""
    reason: str
    """how it was recognised"""
    matrix: Regular | None
    """turns forces as they are read into those that were fitted"""


class GrossError(Part):
    """A gross error that was recognised."""

    name: str
    """its name with its settings"""
    reason: str
    """how"""


class GlobalTest(Part):
    """Test of the residuals against the stated noise."""

    statistic: float
    """weighted sum of squared residuals"""
    dof: int
    """redundancy, its degrees of freedom"""
    sigma_dof: float | None = None
    """those of the stated noise; null if it is known"""
    p_value: float
    """two-sided"""
    accepted: bool
    """at 1 %"""
    remark: str = ""
    """why the test has no power; empty if it has"""


class Suspect(Part):
    """An outlier."""

    position: int
    """number of the hold"""
    p_value: float
    """for all positions together"""


class HeldOut(Part):
    """Errors of positions that the fit to the others predicts."""

    n_predicted: int
    """number of these positions"""
    rms_mps2: float | None
    """of the forces"""
    rms_roll_mgon: float | None = None
    """of roll, with a robot"""
    rms_pitch_mgon: float | None = None
    """and of pitch"""


class VarianceComponents(Part):
    """Factors on the stated variances, with a robot."""

    accelerometer: float
    """of the forces"""
    robot: float
    """of the angles"""
    sigma: list[float | None]
    """their standard deviations"""
    converged: bool
    """whether the estimation converged"""


class Tilt(Part):
    """Tilt error that is left, rms."""

    roll: float | None
    """all of it"""
    pitch: float | None
    """all of it"""
    parameters_roll: float | None = None
    """by the uncertainty of the parameters"""
    parameters_pitch: float | None = None
    """by the uncertainty of the parameters"""
    reference_roll: float | None = None
    """by the calibration of a reference"""
    reference_pitch: float | None = None
    """by the calibration of a reference"""
    max_tilt_gon: float
    """tilts that it is taken over"""


class Quality(Part):
    """How good the calibration is."""

    state: str = ""
    """the verdict: accepted, rejected, cannot tell or implausible"""
    plausible: bool = True
    """whether nothing looks like a gross error"""
    warnings: list[str] = Field([])
    """what does"""
    gross_error: GrossError | None = None
    verdict: str = ""
    """in words"""
    global_test: GlobalTest | None = None
    suspects: list[Suspect] = Field([])
    """outliers, positions in conflict with the others"""
    held_out: HeldOut | None = None
    variance_components: VarianceComponents | None = None
    tilt_rms_mgon: Tilt | None = None


class CalibrationDocument(Document):
    """A calibration; `accelstudy apply` and `export` read it."""

    file = "calibration.json"
    campaign: str
    """name of the campaign"""
    sensor: str | None = None
    """what was calibrated"""
    date: str | None = None
    """when it was measured, ISO 8601"""
    model: str
    """name of the model"""
    effects: Annotated[list[str], Field(min_length=1)]
    """effects of the model, with their settings"""
    approach: str = ""
    """whether angles were used: gravity or robot"""
    reference: Reference | None = None
    type: Type | None = None
    axes: Literal["frd"] = "frd"
    """axes of the parameters: forward, right, down"""
    unit: Literal["m/s^2", "g", "mg", "counts"]
    """of the readings"""
    nominal: Nominal | None
    gravity_mps2: Gravity
    """local gravity"""
    n_positions: Annotated[int, *bounds_of(bounds.POSITIONS)] | None = None
    """positions that were fitted"""
    sigma_source: Literal["a priori", "a posteriori"] = "a posteriori"
    """whether sigmas are quoted by the stated noise or by the residuals"""
    sigma_dof: Annotated[float, *bounds_of(REDUNDANCY)] | None = None
    """degrees of freedom of the noise in the quoted sigmas; null if it is known"""
    sigmas_95: ParameterSigma | None = None
    """number of quoted sigmas that hold 95 %: 1.96 of a known noise, else by Student's t"""
    sigma_position_mps2: ParameterSigma | None
    """noise of a position mean, as quoted"""
    sigma_position_priori_mps2: float | None = None
    """the same, as stated in the header"""
    sigma_position_posteriori_mps2: float | None = None
    """the same, from the residuals"""
    sigma_position_axes_mps2: list[float] | None = None
    """the same of x, y and z, only where a diagnosis found that they differ"""
    sigma_reading_mps2: ParameterSigma | None = None
    """noise of a single reading, from the samples within the holds"""
    parameters: list[Parameter]
    """in SI"""
    covariance: list[list[Annotated[float, *bounds_of(VARIANCE)] | None]]
    """covariance matrix of the parameters, as quoted"""
    correlation: Matrix | None = None
    """correlation matrix"""
    condition: float | None = None
    """condition of the scaled design; 1 is ideal"""
    redundancy: Annotated[int, *bounds_of(REDUNDANCY)] = 0
    """conditions minus unknowns"""
    variance_of_unit_weight: float | None = None
    """a posteriori; 1 if the noise is as stated"""
    iterations: int | None = None
    """iterations of the adjustment"""
    rms_norm_residual_mps2: float | None = None
    """rms of |f| − g"""
    affine: Affine | None = None
    mended: Correction | None = None
    excluded: list[Exclusion] = Field([])
    """positions that were left out"""
    range_mps2: ParameterSigma | None = None
    """the sensor measures ± this"""
    ranges: dict[str, Ends] = Field({})
    """smallest and largest force, time, temperature and vibration in the campaign"""
    log: LogLayout | None = None
    """how the log was read, as in the header of the campaign"""
    warnings: list[str] = Field([])
    """of the reading of the campaign"""
    quality: Quality = Quality()

    @model_validator(mode="after")
    def _whole(self) -> Self:
        names = list(compose(self.model, tuple(self.effects)).parameter_names)
        if [entry.name for entry in self.parameters] != names:
            raise ValueError(f"parameters: expected {', '.join(names)}, in this order")
        if {len(row) for row in self.covariance} | {len(self.covariance)} != {len(names)}:
            raise ValueError(f"covariance: expected {len(names)} rows of {len(names)} numbers")
        covariance = np.array(self.covariance, dtype=float)  # None becomes NaN
        if (known := np.isfinite(np.diag(covariance))).any():
            _check_covariance(covariance[np.ix_(known, known)])
            if self.sigma_source == "a posteriori" and self.redundancy < 1:
                raise ValueError("redundancy: must be 1 or more where sigmas are a posteriori")
        if self.unit == "counts" and self.nominal is None:
            raise ValueError("nominal: missing; unit: counts needs it")
        return self


def _check_covariance(covariance: Array) -> None:
    """Raise `ValueError` unless a matrix (u, u) can be that of estimates."""
    variances = np.diag(covariance)
    if not np.isfinite(covariance).all() or not (variances > LEAST_VARIANCE).all():
        raise ValueError("covariance: expected variances above 0")
    correlation = covariance / np.outer(np.sqrt(variances), np.sqrt(variances))
    if np.abs(correlation - correlation.T).max() > CORRELATION_TOLERANCE:
        raise ValueError("covariance: must be symmetric")
    if np.linalg.eigvalsh(correlation)[0] < -CORRELATION_TOLERANCE:
        raise ValueError("covariance: no estimates have it; it is not positive semidefinite")

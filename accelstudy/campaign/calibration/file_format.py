"""The format of `calibration.json`: its keys, what they mean, and what is checked of them."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from accelstudy.basics import bounds
from accelstudy.basics.arrays import Array
from accelstudy.basics.bounds import Range
from accelstudy.campaign.columns import ANY
from accelstudy.campaign.header import Exclusion, LogLayout, Nominal, PerAxis
from accelstudy.files.documents import Document, Part
from accelstudy.files.validation import (
    Gravity,
    NotNegative,
    ParameterSigma,
    ParameterValue,
    bounds_of,
)
from accelstudy.sensors.models import compose

REDUNDANCY, VARIANCE = Range(0, 10**9), Range(-1e18, 1e18)
MIN_VARIANCE = 1e-40
"""SI, variance below that of any estimate."""
MAX_MATRIX_CONDITION = 1e12
"""Condition of a matrix beyond which it has no inverse."""
CORRELATION_TOLERANCE = 1e-6
"""Numerical tolerance of the checks of a correlation matrix."""

Matrix = list[list[float | None]]


def _regular(matrix: list[list[float]]) -> list[list[float]]:
    if np.linalg.cond(np.array(matrix)) > MAX_MATRIX_CONDITION:
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


class Display(Part):
    """The same as people read it.

    Attributes
    ----------
    value : estimate
    sigma : its standard deviation
    unit : unit, such as ppm or mgon
    """

    value: float | None
    sigma: float | None
    unit: str


class Parameter(Part):
    """A parameter.

    Attributes
    ----------
    name : name
    value : estimate
    sigma : its standard deviation, as quoted
    ci95 : half of its 95 % confidence interval
    sigma_priori : by the stated noise
    sigma_posteriori : by the residuals
    unit : SI unit
    """

    name: str
    value: ParameterValue
    sigma: ParameterSigma | None
    ci95: float | None = None
    sigma_priori: float | None = None
    sigma_posteriori: float | None = None
    unit: str
    shown: Display | None = None


class Reference(Part):
    """The sensor that gave the angles.

    Attributes
    ----------
    calibration : campaign of its calibration
    frame : where its axes point in the axes of the sensor
    sigma_mps2 : standard deviation of its mean in a hold, per axis
    """

    calibration: str
    frame: str
    sigma_mps2: float


class Type(Part):
    """The type of the sensor that was used as prior.

    Attributes
    ----------
    file : its file
    sensors : number of sensors that it is estimated from
    """

    file: str
    sensors: int


class Affine(Part):
    """The calibration as a matrix; null where the model is not linear in the force.

    Attributes
    ----------
    matrix : K of f = K (reading − b)
    bias_mps2 : b of the same
    """

    matrix: Matrix
    bias_mps2: list[float | None]


class Correction(Part):
    """A gross error that a diagnosis corrected.

    Attributes
    ----------
    error : its name with its settings
    reason : how it was recognised
    matrix : turns forces as they are read into those that were fitted
    """

    error: str
    reason: str
    matrix: Regular | None


class GrossError(Part):
    """A gross error that was recognised.

    Attributes
    ----------
    name : its name with its settings
    reason : how
    """

    name: str
    reason: str


class GlobalTest(Part):
    """Test of the residuals against the stated noise.

    Attributes
    ----------
    statistic : weighted sum of squared residuals
    dof : redundancy, its degrees of freedom
    sigma_dof : those of the stated noise; null if it is known
    p_value : two-sided
    accepted : at 1 %
    remark : why the test has no power; empty if it has
    """

    statistic: float
    dof: int
    sigma_dof: float | None = None
    p_value: float
    accepted: bool
    remark: str = ""


class Suspect(Part):
    """An outlier.

    Attributes
    ----------
    position : number of the hold
    p_value : for all positions together
    """

    position: int
    p_value: float


class HeldOutErrors(Part):
    """Errors of positions that the fit to the others predicts.

    Attributes
    ----------
    n_predicted : number of these positions
    rms_mps2 : of the forces
    rms_roll_mgon : of roll, with a robot
    rms_pitch_mgon : and of pitch
    """

    n_predicted: int
    rms_mps2: float | None
    rms_roll_mgon: float | None = None
    rms_pitch_mgon: float | None = None


class VarianceComponents(Part):
    """Factors on the stated variances, with a robot.

    Attributes
    ----------
    accelerometer : of the forces
    robot : of the angles
    sigma : their standard deviations
    converged : whether the estimation converged
    """

    accelerometer: float
    robot: float
    sigma: list[float | None]
    converged: bool


class Tilt(Part):
    """Tilt error that is left, rms.

    Attributes
    ----------
    roll : all of it
    pitch : all of it
    parameters_roll : by the uncertainty of the parameters
    parameters_pitch : by the uncertainty of the parameters
    reference_roll : by the calibration of a reference
    reference_pitch : by the calibration of a reference
    max_tilt_gon : tilts that it is taken over
    """

    roll: float | None
    pitch: float | None
    parameters_roll: float | None = None
    parameters_pitch: float | None = None
    reference_roll: float | None = None
    reference_pitch: float | None = None
    max_tilt_gon: float


class Quality(Part):
    """How good the calibration is.

    Attributes
    ----------
    state : the verdict: accepted, rejected, cannot tell or implausible
    plausible : whether nothing looks like a gross error
    warnings : what does
    verdict : in words
    suspects : outliers, positions in conflict with the others
    """

    state: str = ""
    plausible: bool = True
    warnings: list[str] = Field([])
    gross_error: GrossError | None = None
    verdict: str = ""
    global_test: GlobalTest | None = None
    suspects: list[Suspect] = Field([])
    held_out: HeldOutErrors | None = None
    variance_components: VarianceComponents | None = None
    tilt_rms_mgon: Tilt | None = None

    @property
    def misfit(self) -> GlobalTest | None:
        """The global test if residuals are larger than the stated noise allows, else None."""
        test = self.global_test
        return test if test and not test.accepted and test.statistic > test.dof else None


class CalibrationDocument(Document):
    """A calibration; `accelstudy apply` and `export` read it.

    Attributes
    ----------
    campaign : name of the campaign
    sensor : what was calibrated
    date : when it was measured, ISO 8601
    model : name of the model
    effects : effects of the model, with their settings
    approach : whether angles were used: gravity or robot
    axes : axes of the parameters: forward, right, down
    unit : of the readings
    gravity_mps2 : local gravity
    n_positions : positions that were fitted
    sigma_source : whether sigmas are quoted by the stated noise or by the residuals
    sigma_dof : degrees of freedom of the noise in the quoted sigmas; null if it is known
    sigmas_95 : number of quoted sigmas that hold 95 %: 1.96 of a known noise, else by Student's
        t
    sigma_position_mps2 : noise of a position mean, as quoted
    sigma_position_priori_mps2 : the same, as stated in the header
    sigma_position_posteriori_mps2 : the same, from the residuals
    sigma_reading_mps2 : noise of a single reading, from the samples within the holds
    parameters : in SI
    covariance : covariance matrix of the parameters, as quoted
    correlation : correlation matrix
    condition : condition of the scaled design; 1 is ideal
    redundancy : conditions minus unknowns
    variance_of_unit_weight : a posteriori; 1 if the noise is as stated
    iterations : iterations of the adjustment
    rms_norm_residual_mps2 : rms of |f| − g
    excluded : positions that were left out
    range_mps2 : the sensor measures ± this
    ranges : smallest and largest force, time, temperature and vibration in the campaign
    log : how the log was read, as in the header of the campaign
    warnings : of the reading of the campaign
    """

    file = "calibration.json"
    campaign: str
    sensor: str | None = None
    date: str | None = None
    model: str
    effects: Annotated[list[str], Field(min_length=1)]
    approach: str = ""
    reference: Reference | None = None
    type: Type | None = None
    axes: Literal["frd"] = "frd"
    unit: Literal["m/s^2", "g", "mg", "counts"]
    nominal: Nominal | None
    gravity_mps2: Gravity
    n_positions: Annotated[int, *bounds_of(bounds.POSITIONS)] | None = None
    sigma_source: Literal["a priori", "a posteriori"] = "a posteriori"
    sigma_dof: NotNegative | None = None
    sigmas_95: ParameterSigma | None = None
    sigma_position_mps2: ParameterSigma | None
    sigma_position_priori_mps2: float | None = None
    sigma_position_posteriori_mps2: float | None = None
    sigma_reading_mps2: ParameterSigma | None = None
    parameters: list[Parameter]
    covariance: list[list[Annotated[float, *bounds_of(VARIANCE)] | None]]
    correlation: Matrix | None = None
    condition: float | None = None
    redundancy: Annotated[int, *bounds_of(REDUNDANCY)] = 0
    variance_of_unit_weight: float | None = None
    iterations: int | None = None
    rms_norm_residual_mps2: float | None = None
    affine: Affine | None = None
    mended: Correction | None = None
    excluded: list[Exclusion] = Field([])
    range_mps2: ParameterSigma | None = None
    ranges: dict[str, Ends] = Field({})
    log: LogLayout | None = None
    warnings: list[str] = Field([])
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
    if not np.isfinite(covariance).all() or not (variances > MIN_VARIANCE).all():
        raise ValueError("covariance: expected variances above 0")
    correlation = covariance / np.outer(np.sqrt(variances), np.sqrt(variances))
    if np.abs(correlation - correlation.T).max() > CORRELATION_TOLERANCE:
        raise ValueError("covariance: must be symmetric")
    if np.linalg.eigvalsh(correlation)[0] < -CORRELATION_TOLERANCE:
        raise ValueError("covariance: no estimates have it; it is not positive semidefinite")

"""The format of `history.json`: its keys, and what they mean.

What `plan` reads must be there; earlier versions had other keys beside it.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from accelstudy.files.documents import Document, Part
from accelstudy.files.validation import Finite, NotNegative


class Calibration(Part):
    """A calibration.

    Attributes
    ----------
    campaign : name of the campaign
    date : ISO 8601; null if unknown, of two calibrations
    """

    campaign: str
    date: str | None


class Test(Part):
    """Congruence test of all parameters in all calibrations.

    Attributes
    ----------
    statistic : weighted squares about the mean over their degrees of freedom
    dof : degrees of freedom of F; the second is null if the noise is known
    p_value : of the test
    level : of the test, and of the search for what changed
    """

    statistic: float
    dof: list[float | None]
    p_value: float
    level: float

    @property
    def congruent(self) -> bool:
        """Whether the calibrations are compatible with no change."""
        return self.p_value >= self.level


class Rate(Part):
    """Drift of a parameter, per year.

    Attributes
    ----------
    per_year : rate
    sigma : of the rate
    ci95 : interval if sessions scatter independently
    p_value : of the test of a drift
    """

    per_year: Finite
    sigma: NotNegative
    ci95: list[float | None] | None = None
    p_value: float | None = None


class Scatter(Part):
    """Scatter of a parameter from session to session, beside drift or step.

    Attributes
    ----------
    sd : standard deviation
    ci95 : its interval
    p_value : of the test of scatter
    """

    sd: NotNegative
    ci95: list[float | None] | None = None
    p_value: float | None = None


class Step(Part):
    """A single step instead of a drift.

    Attributes
    ----------
    size : most probable
    sigma : of the size
    after : calibration, from 1, after which it is with a probability of 0.9
    before : calibration before which it is
    probability : of a step, if drifts are as frequent
    """

    size: Finite
    sigma: NotNegative
    after: int
    before: int
    probability: float


class Parameter(Part):
    """A parameter.

    Attributes
    ----------
    name : name
    unit : SI unit
    values : of the calibrations
    sigmas : of these values
    change : the last value less the first
    sigma : of the change
    detectable : steady change from the first to the last calibration that is found in 80 of 100
        cases
    found : what it does; changed if a drift and scatter cannot be distinguished
    or_ : parameters that may have changed instead of it
    rate : null of two calibrations
    scatter : null of two calibrations
    step : null of fewer than four calibrations
    """

    name: str
    unit: str = ""
    values: list[float] = Field([])
    sigmas: list[float] = Field([])
    change: float | None = None
    sigma: float | None = None
    detectable: float | None = None
    found: list[Literal["steps", "drifts", "scatters", "changed"]] = Field([])
    or_: list[str] = Field([], alias="or")
    rate: Rate | None
    scatter: Scatter | None
    step: Step | None = None


class Tilt(Part):
    """Rms by which readings differ that are leveled by the last calibration and by the first.

    Attributes
    ----------
    roll_mgon : in roll
    pitch_mgon : in pitch
    roll_by_chance_mgon : what the noise alone gives
    pitch_by_chance_mgon : what the noise alone gives
    max_tilt_gon : tilts that it is taken over
    """

    roll_mgon: float
    pitch_mgon: float
    roll_by_chance_mgon: float
    pitch_by_chance_mgon: float
    max_tilt_gon: float


class Error(Part):
    """An error that is not exceeded with that probability.

    Attributes
    ----------
    years : time after the last calibration
    mgon : error
    """

    years: float
    mgon: float


class Interval(Part):
    """How long the last calibration can be used; with `--tilt-accuracy` only.

    Attributes
    ----------
    years : duration
    until : its last date
    accuracy_mgon : tilt accuracy that is asked for
    max_tilt_gon : tilts that it is taken over
    confidence : probability
    errors : errors over time
    """

    years: float
    until: str
    accuracy_mgon: float
    max_tilt_gon: float
    confidence: float
    errors: list[Error]


class HistoryDocument(Document):
    """Calibrations of a sensor over time; `accelstudy compare` and `history` write it.

    Attributes
    ----------
    sensor : what was calibrated
    calibrations : by time
    effects : effects that all have
    state : the verdict
    parameters : parameters that all have, in SI
    verdict : in words
    """

    file = "history.json"
    sensor: str | None = None
    calibrations: list[Calibration] = Field([])
    effects: list[str] = Field([])
    state: Literal["unchanged", "changed"] | None = None
    test: Test | None = None
    parameters: list[Parameter]
    tilt: Tilt | None = None
    interval: Interval | None = None
    verdict: str = ""

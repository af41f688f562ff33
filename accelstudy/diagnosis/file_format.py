"""The format of `diagnosis.json`: its keys and what they mean."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field

from accelstudy.basics.registry import Setting
from accelstudy.campaign.calibration.file_format import Correction, Suspect
from accelstudy.effects import Parameter
from accelstudy.files.documents import Document, Part

Probability = Annotated[float, Field(ge=0, le=1.000001)]
"""Sums of probabilities may have rounding errors."""
Names = Annotated[list[str], Field(min_length=1)]


class Fit(Part):
    """Variance of unit weight of a fit: of the base model, or with what was found.

    It is in units of the stated noise; if none is stated, of what the last fit leaves.

    Attributes
    ----------
    model : base or extended
    redundancy : conditions minus unknowns
    simulated : central 95 % of simulated sessions in which the model of the fit is complete
    measured : that of the campaign
    """

    model: Literal["base", "extended"]
    redundancy: int
    simulated: list[float | None]
    measured: float | None


class GlobalTest(Part):
    """Test of the base fit against sigma.

    Attributes
    ----------
    statistic : weighted sum of squared residuals
    dof : redundancy, its degrees of freedom
    p_value : null without a stated sigma
    sigma : whether it is known
    """

    statistic: float
    dof: Annotated[int, Field(ge=1)]
    p_value: Probability | None
    sigma: Literal["known", "unknown"]


class NoiseTest(Part):
    """A test of the noise.

    Attributes
    ----------
    name : noise effect that it looks for
    statistic : of the test
    p_value : of the test
    remark : in words
    """

    name: str
    statistic: float | None
    p_value: Probability | None
    remark: str


class Noise(Part):
    """Noise of a position mean.

    Attributes
    ----------
    sigma_mps2 : as it is taken
    sigma_source : where it comes from
    tests : tests of the noise
    """

    sigma_mps2: Annotated[float, Field(ge=0)]
    sigma_source: Literal["a-priori", "residuals"]
    tests: list[NoiseTest]


class Screening(Part):
    """Test whether anything is missing.

    Attributes
    ----------
    p_value : of anything missing
    simulations : simulated sets of residuals that it is taken from
    candidates : names of all that may be missing
    """

    p_value: Probability | None
    simulations: int
    candidates: list[str]


class Explanation(Part):
    """An explanation of what is missing.

    Attributes
    ----------
    names : what is missing by it
    classes : for each name all names that mean the same in these positions
    posterior : posterior probability
    """

    names: Annotated[Names, Field(max_length=3)]
    classes: Annotated[list[Names], Field(min_length=1, max_length=3)]
    posterior: Probability | None


class Estimate(Part):
    """A parameter or a setting, in SI.

    Attributes
    ----------
    name : name
    value : estimate
    sigma : its standard deviation
    unit : SI unit
    """

    name: str
    value: float | None
    sigma: float | None
    unit: str

    @classmethod
    def of(cls, quantity: Parameter | Setting, value: float, sigma: float) -> Self:
        """Estimate of a parameter or a setting."""
        return cls(name=quantity.name, value=value, sigma=sigma, unit=quantity.unit)


class CertainEffect(Part):
    """What is missing whatever else is open.

    Attributes
    ----------
    family : what its names have in common; empty if they have nothing
    names : names that it may have, most probable first
    posterior : probability that it is missing, whatever its name
    purity : smallest cosine of two of its names; null of one name
    spec : effect that stands for it in the extended model, with its settings
    parameters : those of this effect
    """

    family: str
    names: Names
    posterior: Annotated[float, Field(ge=0.899999, le=1.000001)]
    purity: Probability | None
    spec: str | None
    parameters: list[Estimate]


class FoundEffect(Part):
    """An effect, a noise effect or a gross error that was found.

    Attributes
    ----------
    name : name
    spec : name with its settings
    position : number of an outlier position; null of all else
    equivalence_class : names that mean the same in these positions
    posterior : of the explanation; null of what has no rivals
    parameters : of an effect
    settings : settings that were searched for, such as a knee or a time constant
    imitators : names that could leave the same, and more
    """

    name: str
    spec: str
    position: int | None
    equivalence_class: Names
    posterior: Probability | None
    parameters: list[Estimate]
    settings: list[Estimate]
    imitators: list[str]

    @classmethod
    def of_name(cls, name: str, posterior: float | None = None, at: int | None = None) -> Self:
        """Describe what is no effect: noise, or a gross error, perhaps at a position."""
        return cls(
            name=name, spec=name, position=at, equivalence_class=[name], posterior=posterior,
            parameters=[], settings=[], imitators=[],
        )  # fmt: skip


class Function(Part):
    """A function in SI.

    Attributes
    ----------
    unit : of the values
    coordinate : where it is given
    value : its values, by axis or angle
    sigma : their standard deviations
    """

    unit: str
    coordinate: list[float]
    value: dict[str, list[float | None]]
    sigma: dict[str, list[float | None]]


class Shape(Part):
    """The function that was learned.

    Attributes
    ----------
    coordinate : what it depends on
    target : what depends on it
    axes : axes or angles in which it shows
    subject : the same in words
    """

    coordinate: str
    target: str
    axes: Names
    subject: str
    function: Function


class LikelyPlace(Part):
    """A possible place of what is missing: a function of a coordinate.

    Attributes
    ----------
    coordinate : what it depends on
    target : what depends on it
    posterior : posterior probability, given that what is missing is such a function
    """

    coordinate: str
    target: str
    posterior: Probability


class Change(Part):
    """Without and with what was found.

    Attributes
    ----------
    before : by the base model
    after : by the extended model
    """

    before: float | None
    after: float | None


class HeldOutError(Change):
    """Mean squared error of held-out positions, in units of the noise variance.

    Attributes
    ----------
    floor : with the right model
    """

    floor: float | None


class TiltErrors(Change):
    """Rms of roll and pitch that a calibration leaves, if what was found is right.

    Attributes
    ----------
    promised : by the base model, if that were right
    """

    promised: float | None


class Gap(Part):
    """How far the disagreement shrinks by what was found, and what held-out positions confirm.

    Attributes
    ----------
    sigma0_squared : variance of unit weight
    held_out_z : standard normal if nothing is missing
    held_out_positions : numbers of the positions that were held out
    better_for_leveling : model that leaves the smaller tilt error
    confirmed : whether it is confirmed that something is missing
    confirmed_statement : that an effect of the set is missing, or that it is this name; null if
        nothing is confirmed
    confirmed_names : names of which one is confirmed
    reason : why nothing is confirmed
    """

    sigma0_squared: Change
    held_out_mse: HeldOutError
    held_out_z: float | None
    held_out_positions: list[int]
    leveling_rms_mgon: TiltErrors
    better_for_leveling: Literal["base", "extended"] | None
    confirmed: bool
    confirmed_statement: Literal["effect", "name"] | None
    confirmed_names: list[str]
    reason: str


class UpperLimit(Part):
    """A size that is excluded at 95 %.

    Attributes
    ----------
    name : of the effect
    parameter : its worst one
    value : limit
    unit : SI unit
    """

    name: str
    parameter: str
    value: float | None
    unit: str


class NextPosition(Part):
    """A position that separates the two most probable explanations.

    Attributes
    ----------
    roll_gon : its roll
    pitch_gon : its pitch
    temperature_degC : absent where it does not matter
    later_s : time after the last position; absent where it does not matter
    separates : names that only one of the two has
    """

    roll_gon: float
    pitch_gon: float
    temperature_degC: float | None = None
    later_s: Annotated[float, Field(ge=0)] | None = None
    separates: Names


class CalibrationFile(Part):
    """The calibration with what was found.

    Attributes
    ----------
    file : its file; null where the fit cannot be assessed
    mended : a gross error that it was corrected for
    reason : why there is no file
    """

    file: str | None
    mended: Correction | None = None
    reason: str | None = None


class DiagnosisDocument(Document):
    """What a model lacks; `accelstudy diagnose` writes it.

    Each verdict but `no_effect`, `noise_model` and `gross_error` comes with explanations. `named`
    and `narrowed` come with one to three effects, `learned` with a function, whose effect comes
    first, `noise_model` and `gross_error` with what was found; `no_effect` and `unknown` name none.

    Attributes
    ----------
    campaign : name of the campaign
    approach : whether angles were used: gravity or robot
    model : name of the model that was diagnosed
    axes : axes of all parameters: forward, right, down
    verdict : what the diagnosis comes to
    reason : why this verdict
    fits : of the base model, and with what was found
    posterior : posterior probability of each name, alone or with others; names that mean the same
        stand under one
    credible_set : explanations, most probable first, until they hold 0.9 together
    certain : what is missing whatever else is open
    effects : what was found; of a set that was narrowed, the most probable explanation
    suspects : positions that a calibration with the base model marks as outliers
    like : possible places of what is missing, most probable first
    invisible_effects : what this campaign cannot show, however large
    untestable_effects : effects that cannot be tested, and why, such as a column that is absent
    upper_limits : of effects that were neither found nor left open
    next_positions : positions that separate the two most probable explanations best
    redundancy : of all that is tested
    n_positions : positions of the campaign
    warnings : of the reading of the campaign
    rules : prior weights, levels and thresholds of this diagnosis
    """

    file = "diagnosis.json"
    campaign: str
    approach: str
    model: str
    axes: Literal["frd"]
    verdict: Literal[
        "no_effect", "named", "narrowed", "learned", "unknown", "noise_model", "gross_error"
    ]
    reason: str
    fits: Annotated[list[Fit], Field(min_length=1, max_length=2)]
    global_test: GlobalTest
    noise: Noise
    screening: Screening
    posterior: dict[str, Probability | None]
    credible_set: list[Explanation]
    certain: Annotated[list[CertainEffect], Field(max_length=3)]
    effects: list[FoundEffect]
    suspects: list[Suspect]
    shape: Shape | None
    like: list[LikelyPlace]
    gap: Gap
    invisible_effects: list[str]
    untestable_effects: dict[str, str]
    upper_limits: list[UpperLimit]
    next_positions: list[NextPosition]
    redundancy: int
    n_positions: int
    warnings: list[str]
    rules: dict[str, float]
    calibration: CalibrationFile

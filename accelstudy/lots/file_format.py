"""The format of `lot.json`: its keys, and what they mean."""

from __future__ import annotations

from pydantic import Field

from accelstudy.files.documents import Document, Part


class MissingEffectTest(Part):
    """Test whether anything is missing.

    Attributes
    ----------
    p_value : of the test
    missing : whether something is missing
    level : of the test
    """

    p_value: float
    missing: bool
    level: float


class Parameter(Part):
    """A parameter over the sensors.

    Attributes
    ----------
    name : name
    mean : of the type
    scatter : sd from sensor to sensor
    scatter_ci95 : its 95 % interval
    sigma : of the mean
    unit : SI unit
    """

    name: str
    mean: float | None
    scatter: float | None
    scatter_ci95: list[float | None]
    sigma: float | None
    unit: str


class Effect(Part):
    """An effect that the model lacks.

    Attributes
    ----------
    names : effects that the lot cannot distinguish, the most probable one first
    posterior : posterior probability, given that anything is wrong
    share : part of the sensors that have it
    share_ci95 : its 95 % interval
    spec : the effect in the setting that explains most; null for what is no effect
    parameters : its sizes, in SI
    """

    names: list[str]
    posterior: float
    share: float
    share_ci95: list[float | None]
    spec: str | None
    parameters: list[Parameter]


class Alternative(Part):
    """An explanation.

    Attributes
    ----------
    names : its effects
    posterior : posterior probability
    """

    names: list[str]
    posterior: float


class OddSensor(Part):
    """A sensor with an effect that the others do not have, or have in another size.

    Attributes
    ----------
    campaign : its campaign
    posterior : probability that it is odd
    names : effects that it may have
    by_size : whether the others have the effect, too, in another size
    """

    campaign: str
    posterior: float
    names: list[str]
    by_size: bool


class SensorState(Part):
    """A sensor, given the lot.

    Attributes
    ----------
    campaign : its campaign
    names : what the model lacks for it; `odd` is something of its own
    posterior : posterior probability
    failed : why it has no calibration with the model of the type
    """

    campaign: str
    names: list[str]
    posterior: float
    failed: str | None = None


class ExcludedCampaign(Part):
    """A campaign that is not in the lot.

    Attributes
    ----------
    campaign : its name
    reason : why
    """

    campaign: str
    reason: str


class Tilt(Part):
    """Rms tilt error by what is missing; null if no effect was found.

    Attributes
    ----------
    roll_mgon : in roll
    pitch_mgon : in pitch
    max_tilt_gon : tilts that it is taken over
    """

    roll_mgon: float
    pitch_mgon: float
    max_tilt_gon: float


class LotDocument(Document):
    """A lot of sensors; `accelstudy lot` writes it.

    Attributes
    ----------
    sensors : number of sensors
    effects : what the model lacks, where the name is sure
    explained : false if no name explains what the sensors have in common; then there are no
        effects
    close : effects that come closest to it
    alternatives : the most probable explanations
    odd : odd sensors
    each : what the model lacks for each sensor
    left_out : campaigns that are not in the lot
    verdict : in words
    files : all other files of the folder
    """

    file = "lot.json"
    sensors: int
    anything: MissingEffectTest
    effects: list[Effect]
    explained: bool
    close: list[list[str]]
    alternatives: list[Alternative]
    odd: list[OddSensor]
    each: list[SensorState]
    left_out: list[ExcludedCampaign]
    tilt: Tilt | None
    verdict: str
    files: list[str] = Field([])

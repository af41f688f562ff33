"""How public functions take campaigns, models, approaches and prior knowledge."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

from accelstudy.approaches import Approach, get_approach
from accelstudy.basics.arguments import check_type, path_of
from accelstudy.campaign.calibration.campaign_fit import CampaignFit
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.format import read_campaign
from accelstudy.campaign.gross_errors.recognition import check_plausible
from accelstudy.campaign.sensor_type import with_type
from accelstudy.campaign.session import Campaign
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel


def as_campaign(campaign: Any, plausible: bool = True) -> Campaign:
    """Return a campaign, read if it is given as the path of its folder."""
    if isinstance(campaign, str | PathLike):
        return read_campaign(path_of("campaign", campaign), plausible=plausible)
    check_type(
        "campaign", campaign, Campaign, expected="a Campaign, as find_holds returns, or a path"
    )
    if plausible:
        check_plausible(campaign, campaign.name)
    return campaign


def campaign_path(campaign: Any) -> Path | None:
    """Path of a campaign, for the commands that are suggested; None if it is in memory."""
    return None if isinstance(campaign, Campaign) else Path(campaign)


def model_and_approach(model: str, approach: str | None) -> tuple[SensorModel, Approach | None]:
    """Return the model and the approach that are named."""
    return get_model(model), None if approach is None else get_approach(approach)


def resolve(
    campaign: Any, model: str, approach: str | None, prior: Any = None, plausible: bool = True
) -> tuple[Campaign, SensorModel, Approach | None]:
    """Read the campaign, the model, the approach and what is known of the sensor a priori."""
    names = model_and_approach(model, approach)
    return with_type(as_campaign(campaign, plausible), prior, names[0]), *names


def fit_of(campaign: Any, model: str, approach: str | None, prior: Any = None) -> CampaignFit:
    """Adjust a campaign by the keywords of `calibrate`."""
    return fit_campaign(*resolve(campaign, model, approach, prior))

"""A round trip: a campaign with hidden effects that is simulated and diagnosed.

`workflow/diagnose.smk` runs it, and `config/diagnose-example.yaml` is an example.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator, Field, model_validator

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.names import check_path_name
from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign, write_truth
from accelstudy.config_names import ModelName
from accelstudy.files.validation import Configuration, Seed, validate
from accelstudy.sensors.models import get_model


def _known_settings(value: Any) -> Any:
    names = [field.name for field in fields(CampaignSettings)]
    for name in value if isinstance(value, Mapping) else ():
        if name not in names:
            raise UnknownNameError("setting", name, names)
    return value


Settings = Annotated[CampaignSettings, BeforeValidator(_known_settings)]


class RoundTrip(Configuration):
    """A simulated campaign and its diagnosis; results go to ``results/<name of the campaign>``."""

    retired: ClassVar = {"replicates": "nothing is simulated; model.yaml is a study that does it"}

    campaign: Settings = Field(description="settings of the simulated campaign, SI")
    model: ModelName = Field("bias-scale-nonorthogonality", description="model that is diagnosed")
    approach: str | None = Field(None, description="robot if the campaign has one, by default")
    seed: Seed = Field(1, description="of the diagnosis")

    @model_validator(mode="after")
    def _names_exist(self) -> RoundTrip:
        try:
            check_path_name(self.campaign.name)
        except InputError as error:
            raise ValueError(f"campaign.name: {error}") from None
        get_model(self.model)
        if self.approach is not None:
            get_approach(self.approach)
        return self


def parse_round_trip(content: Mapping[str, Any], source: str = "config") -> RoundTrip:
    """Check a configuration; raise `InputError` with one line that names the source and the key."""
    return validate(RoundTrip, content, source)


def write_simulated(settings: CampaignSettings, folder: str | Path, truth: str | Path) -> None:
    """Simulate a campaign and write it, and its truth apart from it."""
    campaign, hidden = simulate_campaign(settings)
    write_campaign(campaign, folder, plausible=not settings.gross_errors)
    write_truth(hidden, truth)

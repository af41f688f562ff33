"""Calibrations of one simulated sensor, as `calibration.json` has them."""

from accelstudy.approaches import get_approach
from accelstudy.campaign.calibration.assessment import assess
from accelstudy.campaign.calibration.document import (
    calibration_document,
    json_text,
    quality_document,
)
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.sensors.models import get_model

SENSOR = ("bias: 0.1, 0.05, -0.1", "scale: 0.002, -0.001, 0.003",
          "nonorthogonality: 0.003, -0.002, 0.001")  # fmt: skip
NINE = "bias-scale-nonorthogonality"


def document(seed, *, model=NINE, approach="gravity", effects=SENSOR, **settings):
    """Content of the calibration.json of a session with the sensor."""
    settings = CampaignSettings(seed=seed, effects=effects, name=f"session-{seed}", **settings)
    fit = fit_campaign(simulate_campaign(settings)[0], get_model(model), get_approach(approach))
    return {**calibration_document(fit), "quality": quality_document(assess(fit))}


def write_document(path, seed, **options):
    """Write a calibration.json."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json_text(document(seed, **options)), encoding="utf-8")

"""Calibrations of one simulated sensor, as `calibration.json` has them."""

import accelstudy as acs
from accelstudy.files.documents import json_text

SENSOR = ("bias: 0.1, 0.05, -0.1", "scale: 0.002, -0.001, 0.003",
          "nonorthogonality: 0.003, -0.002, 0.001")  # fmt: skip
NINE = "bias-scale-nonorthogonality"


def document(seed, *, model=NINE, approach="gravity", effects=SENSOR, **settings):
    """Content of the calibration.json of a session with the sensor."""
    named = {"seed": seed, "name": f"session-{seed}", "effects": effects}
    campaign = acs.simulate_campaign(**named, **settings)
    return {**acs.calibrate(campaign, model=model, approach=approach).content}


def write_document(path, seed, **options):
    """Write a calibration.json."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json_text(document(seed, **options)), encoding="utf-8")

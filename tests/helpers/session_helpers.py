"""Calibrations of one simulated sensor."""

import accelstudy as acs

SENSOR = ("bias: 0.1, 0.05, -0.1", "scale: 0.002, -0.001, 0.003",
          "nonorthogonality: 0.003, -0.002, 0.001")  # fmt: skip
NINE = "bias-scale-nonorthogonality"


def calibrated(seed, *, model=NINE, approach="gravity", effects=SENSOR, **settings):
    """Calibration of a session with the sensor."""
    named = {"seed": seed, "name": f"session-{seed}", "effects": effects}
    campaign = acs.simulate_campaign(**named, **settings)
    return acs.calibrate(campaign, model=model, approach=approach)

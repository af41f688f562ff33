"""The plan: the cheapest calibration that reaches a tilt accuracy."""

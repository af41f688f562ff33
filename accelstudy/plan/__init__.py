"""The cheapest calibration that reaches a tilt accuracy: what to measure, with what, how long."""

"""Calibration position by position: estimate, choose the next one, stop when it is enough."""

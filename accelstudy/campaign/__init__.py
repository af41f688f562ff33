"""Measured calibration sessions (campaigns): from raw logs to calibrations, and their use."""

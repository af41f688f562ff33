"""The design of a calibration: what a scheme can determine, and the best positions."""

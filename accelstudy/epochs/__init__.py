"""Calibrations of one sensor at several times: comparison of two, history of more."""

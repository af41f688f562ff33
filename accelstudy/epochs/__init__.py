"""Calibrations of one sensor at several times, and whether it is still what it was."""

"""Levels of the tests that several rooms share."""

REFUTED = 0.01
"""Level at which residuals refute a stated sigma, in every command and on every page."""

"""Holds: where a log is at rest, found by its variance, with their means and noise."""

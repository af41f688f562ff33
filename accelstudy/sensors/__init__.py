"""Sensors: models composed of effects, frames, units, and bounds of what is plausible."""

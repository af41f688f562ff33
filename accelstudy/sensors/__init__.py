"""Sensors: models composed of effects, frames, and what no real sensor can have."""

"""Positions of a sensor: what a scheme is, and points on the cube and on the sphere."""

"""Optimal position schemes: which attitudes calibrate a sensor best, for a given use of it."""

"""Estimates from the positions so far, updated with one position at a time."""

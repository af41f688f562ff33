"""Leveling: roll and pitch from a force, their error, and which parameters cause it."""

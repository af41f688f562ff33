"""Simulated calibrations of a cell, and the statistics that follow from them."""

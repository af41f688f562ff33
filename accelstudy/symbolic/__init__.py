"""Formulas with symbols: traced once, differentiated exactly, and turned into array functions."""

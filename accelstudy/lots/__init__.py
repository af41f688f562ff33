"""Lots: many sensors of one type, evaluated together for the effects that their model lacks."""

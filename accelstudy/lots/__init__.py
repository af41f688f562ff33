"""Lots: what many sensors of one type say together about what their model lacks."""

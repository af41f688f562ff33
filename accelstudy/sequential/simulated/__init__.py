"""Simulated sessions that follow the advice, and their results."""

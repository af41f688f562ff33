"""Simulated sessions that follow the advice, and what came of them."""

"""Simulated campaigns, with hidden effects and gross errors whose truth is recorded."""

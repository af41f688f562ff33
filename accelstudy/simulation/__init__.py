"""Simulated sessions: noise, observations, and when and how warm each hold is."""

"""Simulated sessions: noise, observations, and the conditions of each hold."""

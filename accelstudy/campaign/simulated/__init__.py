"""Simulated campaigns with effects and gross errors of your choice, and their truth."""

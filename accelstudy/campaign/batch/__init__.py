"""Batches: many campaigns calibrated by one configuration, and their overview."""

"""Gross errors of a campaign: how they are recognised, and undone."""

"""Advice while a campaign is being measured."""

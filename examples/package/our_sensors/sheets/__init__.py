"""Data sheets of our sensors."""

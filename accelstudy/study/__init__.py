"""A study: its configuration, its cells, their simulation, and the tables that come of it."""

"""A study: its configuration, its cells, their simulation, and its tables and figures."""

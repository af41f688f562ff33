"""The files for programs: JSON, YAML and the table of the positions."""

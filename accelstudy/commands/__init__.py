"""The command line: commands made of the public functions."""

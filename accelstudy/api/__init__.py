"""The classes of results that the public functions return, and how their arguments are read."""

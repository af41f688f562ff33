"""Studies that test the package, and are no part of it."""

"""The functions for programs: few, and thin over the rooms that do the work."""

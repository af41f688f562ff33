"""The pole: the error of its foot if roll and pitch correct the tilt, and its sources."""

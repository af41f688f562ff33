"""The format of a campaign: header, positions, and the checks when they are read."""

"""Whether the noise is what it is taken for: level, axes, colour, tails, resolution."""

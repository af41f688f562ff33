"""Whether the noise is as assumed: its level, axes, colour, tails and resolution."""

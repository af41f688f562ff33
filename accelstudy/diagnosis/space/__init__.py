"""The space of residuals, and the hypotheses that live in it."""

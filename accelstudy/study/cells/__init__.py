"""Cells of a study: one model, scheme and approach each; how they are shared out to jobs."""

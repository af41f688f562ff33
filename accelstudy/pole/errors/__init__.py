"""The error of the foot: its sources, their budget by linear theory, and the Monte Carlo."""

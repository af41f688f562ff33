"""Which position comes next, and when the accuracy is reached."""

"""What the positions so far tell: estimates that take one position at a time."""

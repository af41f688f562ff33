"""Units, errors, words, names and numbers: what every other room uses."""

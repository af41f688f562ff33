"""The score: answers beside truths, shares, limits and targets."""

"""The decision: posterior probabilities of explanations, and the verdict."""

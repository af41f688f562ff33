"""The page about a diagnosis."""

"""The results for a pole: sentences, figure, files, and the configuration that asks for them."""

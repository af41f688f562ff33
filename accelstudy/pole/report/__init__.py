"""What comes of a pole: sentences, figure, files, and the configuration that asks for them."""

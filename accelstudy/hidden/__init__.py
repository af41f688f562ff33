"""The hidden-effect study: campaigns with known causes, and how well the diagnosis finds them."""

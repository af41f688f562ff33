"""A proposed design: from a request to ordered positions, a file and a figure."""

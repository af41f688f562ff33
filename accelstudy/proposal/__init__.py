"""A proposed design: from the request to ordered positions, a file and a figure."""

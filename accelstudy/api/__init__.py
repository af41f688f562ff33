"""Arguments of the public functions, and their results in which several rooms have a part."""

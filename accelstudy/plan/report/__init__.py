"""A plan for its reader: the answer in words, its reasons, table, figure and files."""

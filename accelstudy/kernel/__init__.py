"""The adjustment of many replicates as compiled code, for large studies.

The same traced formulas that NumPy evaluates become a function for eight replicates at a time.
"""

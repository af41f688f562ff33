"""The adjustment of many replicates as compiled code, for large studies.

The same traced formulas that NumPy evaluates become a function for eight replicates at a time.

The iteration stands here a second time, in vectors. A loop over replicates that Numba compiles from
the same formulas reaches 0.3 of this speed (`benchmarks/ways/numba_loop.py`).
"""

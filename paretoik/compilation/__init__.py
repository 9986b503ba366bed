"""Compiled code: the cache of what numba compiles, tuples of arrays by reference, and notices. Home of numba."""

"""Compiled code: the cache of numba's output, tuples of arrays by reference, notices. Home of numba."""

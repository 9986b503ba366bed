"""Compiled code: numba's cache, and tuples of arrays by reference."""

"""Compiled parts of evolutionary search, for loops that search a thousand times a second: numba code on plain arrays."""

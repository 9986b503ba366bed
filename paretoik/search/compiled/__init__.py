"""Compiled parts of evolutionary search, for a thousand searches a second: numba code on plain arrays."""

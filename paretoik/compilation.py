"""How numba compiles: once for every machine it runs on, and without holding up other threads."""

from __future__ import annotations

from numba import njit

compiled = njit(cache=True, nogil=True, error_model="numpy")  # as NumPy, division by 0 gives inf or nan

# Functions that take functions are written into their callers: with a function as argument, nothing could be cached.
inlined = njit(inline="always", nogil=True, error_model="numpy")

"""What of a search runs compiled, for loops that run it a thousand times a second: numba code on plain arrays."""

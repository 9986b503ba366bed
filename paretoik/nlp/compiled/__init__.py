"""What runs compiled: numba code on plain arrays, nothing else."""

"""Marcos et al. 2012: the control step, its compiled search, the exact step."""

"""Closed loop of Marcos et al. 2012: control step, its compiled search, loop, and exact step."""

"""The closed loop of Marcos et al. 2012: the control step, its compiled search, the loop, the exact step."""

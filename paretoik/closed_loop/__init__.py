"""The closed loop of Marcos et al. 2012. It has the control step, its compiled search, the loop, and the exact step."""

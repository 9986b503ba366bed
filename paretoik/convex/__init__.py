"""WHAT IS CONVEX: the only home of cvxpy and Clarabel."""

"""HOW A MOTION IS POLISHED: its nonlinear program, its solver, multi-start, ε-constraints, certificates."""

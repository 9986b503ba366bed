"""Tracing of NumPy functions, exact derivatives, kinks, the compiled evaluator. Knows no robot."""

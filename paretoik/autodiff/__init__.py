"""Tracing of NumPy functions, exact derivatives, kinks and the compiled evaluator; independent of robots."""

"""HOW FUNCTIONS ARE DIFFERENTIATED: expressions traced from NumPy code, their derivatives, and a compiled evaluator."""

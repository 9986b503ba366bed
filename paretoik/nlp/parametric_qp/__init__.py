"""Optima that follow a parameter, compiled: quadratic programs, second-order models, predictor and corrector."""

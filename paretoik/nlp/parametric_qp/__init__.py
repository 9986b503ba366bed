"""Optima that follow a parameter, compiled.

Quadratic programs, second-order models, predictor and corrector.
"""

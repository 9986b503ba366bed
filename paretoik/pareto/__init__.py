"""Certified fronts of any program: refinement, epsilon sweeps, gap filling, exchange rates."""

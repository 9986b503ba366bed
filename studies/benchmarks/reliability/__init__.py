"""Runs that are killed, cut and damaged: losses, and results after they resume."""

"""Preferences: each chooses one point of a front and says why."""

from paretoik.front.preferences.weights import Weights

__all__ = ["Weights"]

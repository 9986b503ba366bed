"""The Pareto front: its points and certificates, indicators, preferences and storage."""

from paretoik.front.front import Choice, Front, Preference
from paretoik.front.indicators import hypervolume, ideal_and_nadir, non_dominated
from paretoik.front.preferences import Weights

__all__ = ["Choice", "Front", "Preference", "Weights", "hypervolume", "ideal_and_nadir", "non_dominated"]

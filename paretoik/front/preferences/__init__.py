"""Preferences: each chooses one point of a front and says why.

All use shares of the stored ranges of the front, Z = (f − ideal)/(nadir − ideal) (``front.shares``), so that further
points do not move a choice; ``front.choice.first_row`` decides ties.
"""

from paretoik.front.preferences.aspiration import Aspiration, Classify
from paretoik.front.preferences.knee_and_compromise import Knee
from paretoik.front.preferences.requests import Bounds
from paretoik.front.preferences.weights import Lexicographic, Robust, Weights

__all__ = ["Aspiration", "Bounds", "Classify", "Knee", "Lexicographic", "Robust", "Weights"]

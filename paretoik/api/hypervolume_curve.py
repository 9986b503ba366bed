"""The hypervolume of a front that grows, up to one corner: that of the first front, so that it never falls."""

from __future__ import annotations

import numpy as np

from paretoik.arrays import Objectives
from paretoik.front.indicators import hypervolume
from paretoik.pareto.scalarisation import ranges_of


class HypervolumeCurve:
    """Hypervolumes of fronts in the order in which they came, objectives minimised."""

    def __init__(self) -> None:
        self._corner: Objectives | None = None

    def __call__(self, front: Objectives) -> float:
        """Return the hypervolume of the next front; 0 as long as all were empty."""
        if self._corner is None and len(front):
            worst = front.max(axis=0)
            self._corner = worst + np.maximum(ranges_of(front), 0.1 * np.abs(worst))
        return 0.0 if self._corner is None else hypervolume(front, self._corner)

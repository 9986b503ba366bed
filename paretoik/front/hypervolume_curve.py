"""The hypervolume of a front that grows, up to one corner: that of the first front, so that it never falls."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from paretoik.arrays import Objectives, Values
from paretoik.front.indicators import estimate_hypervolume, ranges_of


@dataclass(frozen=True, kw_only=True)
class HypervolumeOptions:
    """Up to this ``share`` of the time goes into hypervolumes, beside those that take less than ``free`` [s].

    With thousands of points they cost more than the search: 0.28 s for 18,000 in four objectives, 0.2 s the generation.
    """

    share: float = 0.01
    free: float = 0.001


OPTIONS = HypervolumeOptions()


class HypervolumeCurve:
    """Hypervolumes of fronts in the order in which they came, objectives minimised, as long as there is time."""

    def __init__(self, options: HypervolumeOptions = OPTIONS) -> None:
        self._options = options
        self._corner: Values | None = None
        self._width: Values | None = None  # of the first front with the corner
        self._started, self._spent, self._latest = time.monotonic(), 0.0, 0.0
        self._value, self._number = 0.0, 0

    def corner(self, front: Objectives) -> Values | None:
        """Return the corner (n_obj,), which the first front fixes; None as long as all were empty."""
        if self._corner is None and len(front):
            worst = front.max(axis=0)
            self._corner = worst + np.maximum(ranges_of(front), 0.1 * np.abs(worst))
        return self._corner

    def measure(self, front: Objectives, number: int, corner: Values | None = None) -> float | None:
        """Return the hypervolume of the front of a generation; None where there is no time for it.

        It reaches up to a ``corner`` (n_obj,), which must always be the same; by default up to that of the first front.
        """
        corner = self.corner(front) if corner is None else corner
        elapsed = time.monotonic() - self._started
        if self._latest > self._options.free and self._spent > self._options.share * elapsed:
            return None
        started = time.thread_time()
        former, self._number = self._value, number
        self._value = 0.0 if corner is None else self._estimate(front, corner)
        if former:  # the first loads a library, too
            self._latest = time.thread_time() - started
            self._spent += self._latest
        return self._value

    def summary(self, number: int) -> str:
        """Return the last hypervolume in words, with its generation if that is another than the present one."""
        then = "" if self._number == number else f" of generation {self._number}"
        return f"hypervolume {self._value:.4g}{then}"

    def _estimate(self, front: Objectives, corner: Values) -> float:
        if self._width is None:
            self._width = ranges_of(np.vstack([front, corner]))
        return estimate_hypervolume(front, corner, self._width)

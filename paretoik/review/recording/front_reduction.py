"""What is kept of a generation whose front has more points than a picture can show, and its hypervolume."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Int

from paretoik.arrays import Objectives
from paretoik.front.hypervolume_curve import HypervolumeCurve, HypervolumeOptions
from paretoik.review.recording.recorder import Generation
from paretoik.search.insertion import greedy_order, scaled, starting_points

OPTIONS = HypervolumeOptions(share=0.25)
"""The process that records has time that the run has not."""


class FrontReduction:
    """Reduces generations of a search, whose objectives are ``maximised`` or not, to at most so many ``points``."""

    def __init__(self, *, maximised: tuple[bool, ...], points: int) -> None:
        self._signs = np.where(maximised, -1.0, 1.0)
        self._points = points
        self._hypervolume = HypervolumeCurve(OPTIONS)

    def reduce(self, generation: Generation) -> Generation:
        """Return a generation with points that MaxiMin spreads over its front, the ends among them."""
        volume, front = generation.hypervolume, generation.front
        if volume is None and generation.reference is not None:
            reference = generation.reference * self._signs
            volume = self._hypervolume.measure(front * self._signs, generation.number, reference)
        generation = replace(generation, hypervolume=volume, size=len(front))
        if len(front) <= self._points:
            return generation
        rows = spread_rows(front * self._signs, self._points)
        origins = None if generation.origins is None else generation.origins[rows]
        return replace(generation, front=front[rows], front_ids=generation.front_ids[rows], origins=origins)


def reduction_note(generations: Sequence[Generation]) -> str:
    """Return in words what was left out of the fronts of generations, "" for nothing."""
    reduced = [len(each.front) for each in generations if each.size is not None and each.size > len(each.front)]
    if not reduced:
        return ""
    return f"Of a front on the way {max(reduced)} points are drawn at most, spread over it, its ends among them."


def spread_rows(F: Objectives, count: int) -> Int[np.ndarray, " rows"]:
    """Return in their order the rows of so many points of a front, minimised: the best of each objective, and MaxiMin.

    Marcos et al. (2012); see ``search.maximin``.
    """
    Z = scaled(F, F.min(axis=0), F.max(axis=0))
    starts = list(dict.fromkeys([*F.argmin(axis=0).tolist(), *starting_points(Z)]))[:count]
    order, _ = greedy_order(Z, count, np.full(len(Z), np.inf), starts)
    return np.asarray(np.sort(order))

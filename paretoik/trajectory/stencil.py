"""How rates at the samples follow from positions at the samples, and which positions can move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from paretoik.task.differences import first_derivative, second_derivative
from paretoik.task.motion_task import MotionTask


@dataclass(frozen=True, kw_only=True, eq=False)
class Stencil:
    """u of sample i is Σ_k ``weights``[order, i, k] q of sample ``window``[i, k].

    The steps of sample i begin at ``place``[i] among the unknowns (−1: it cannot move), of which the last ``seam``
    belong to the border: those that couple the end of a cycle to its start. On a cycle the last sample moves with the
    first; where the motion stops, with the one before, as far as the path lets it.
    """

    window: Int[np.ndarray, "time width"]
    weights: Float[np.ndarray, "orders time width"]
    place: Int[np.ndarray, " time"]
    unknowns: int
    seam: int


def stencil(task: MotionTask, orders: int) -> Stencil:
    """Return how rates at the samples follow from positions at the samples."""
    samples = len(task.times)
    level = [np.eye(samples)]
    level.append(first_derivative(level[0], task.times, task.differences, cyclic=task.cyclic))
    level.append(second_derivative(level[0], task.times, task.differences, cyclic=task.cyclic))
    level.append(first_derivative(level[2], task.times, task.differences, cyclic=task.cyclic))
    known = np.stack(level[:orders])
    free = samples
    if task.cyclic:  # the last sample is the first
        known[..., 0] += known[..., -1]
        known[..., -1] = 0.0
        free = samples - 1
    touched = (known != 0).any(axis=0)
    width = int(touched.sum(axis=1).max())
    window = np.sort(np.argsort(~touched, axis=1, kind="stable")[:, :width], axis=1)
    weights = np.take_along_axis(known, np.broadcast_to(window, (orders, *window.shape)), axis=2)
    fixed = int(task.start is not None)
    place = np.where(np.arange(samples) < fixed, -1, (np.arange(samples) - fixed) * task.redundancy)
    if task.cyclic:
        place[-1] = place[0]
    if task.ends_at_rest:
        place[-1] = place[-2]
    reach = int(np.max(np.where(touched, np.abs(np.arange(samples) - np.arange(samples)[:, None]), 0)[: free // 2]))
    seam = 2 * (width - 1) if task.cyclic else 0
    assert not task.cyclic or free > 2 * seam, reach
    return Stencil(
        window=window,
        weights=np.ascontiguousarray(weights),
        place=place,
        unknowns=int(place.max()) + task.redundancy,
        seam=seam * task.redundancy,
    )

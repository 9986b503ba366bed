"""Motions between their samples: the projected curve on finer grids, and the largest value that it reaches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from jaxtyping import Float
from numpy.lib.stride_tricks import sliding_window_view

from paretoik.arrays import read_only
from paretoik.task.curves import SmoothCurve
from paretoik.task.motion import Motion
from paretoik.task.spline import Derivatives

Pieces = Float[np.ndarray, "pieces instants"]
Columns = Float[np.ndarray, "pieces instants columns"]


@dataclass(frozen=True, kw_only=True)
class RefinementOptions:
    """Settings of grids between samples.

    steps: steps of an interval between two samples, and of a step that is divided again
    width: points of a finite difference
    divisions: largest number of steps that are divided at once
    rounds: most times that steps are divided
    rounding: share of a limit's range by which a bound may be above the largest value
    share: share of the largest value by which it may be above that
    """

    steps: int = 8
    width: int = 6
    divisions: int = 64
    rounds: int = 12
    rounding: float = 1e-10
    share: float = 1e-3


OPTIONS = RefinementOptions()


def finer_motion(motions: Motion, refinement: int = OPTIONS.steps) -> Motion:
    """Return the projected curves of motions (*batch, time, dof) of one task on a finer grid.

    Velocities and accelerations are those of the curve, whatever the motions' differences are.

    Raises Infeasible if a motion leaves its path between its samples.
    """
    time = motions.time.reshape(-1, motions.time.shape[-1])[0]
    curves = curve_on(motions, divide(time, refinement))

    def join(values: np.ndarray) -> np.ndarray:
        shape = (*motions.q.shape[:-2], -1, values.shape[-1])
        return np.concatenate([values[..., :-1, :].reshape(shape), values[..., -1, -1:, :]], axis=-2)

    q, dq, ddq, jerk = map(join, curves)
    derivatives = Derivatives(dq=dq, ddq=ddq, jerk=jerk, velocity_bounds=dq)
    finer = np.append(divide(time, refinement)[:, :-1], time[-1])
    return replace(motions, time=finer, q=q, derivatives=derivatives)


def divide(time: Float[np.ndarray, " time"], steps: int = OPTIONS.steps) -> Pieces:
    """Return the times of all intervals between times, each divided into steps."""
    return np.linspace(time[:-1], time[1:], steps + 1, axis=1)


def curve_on(motions: Motion, times: Pieces) -> tuple[Float[np.ndarray, "*batch pieces instants dof"], ...]:
    """Return position, velocity, acceleration and jerk of the curves of motions at times, evenly spaced in each piece.

    They are exact except the jerk, a difference. On a path that does not know its rates velocity and acceleration are
    the spline's, and differences of the small correction onto the path.
    """
    steps = (times[:, -1] - times[:, 0]) / (times.shape[1] - 1)
    shape = (*motions.q.shape[:-2], *times.shape, motions.arm.dof)

    def slope(values: np.ndarray, order: int = 1) -> np.ndarray:
        return _difference_matrix(times.shape[1], order) @ values / steps[:, None, None] ** order

    if all(isinstance(task.path.curve, SmoothCurve) for task in motions.tasks):
        q, dq, ddq = (part.reshape(shape) for part in motions.state(times.ravel()))
    else:
        spline = [part.reshape(shape) for part in motions.state(times.ravel(), project=False)]
        q = motions.at(times.ravel()).reshape(shape)
        dq, ddq = (spline[order] + slope(q - spline[0], order) for order in (1, 2))
    return q, dq, ddq, slope(ddq)


def largest_between(evaluate: Callable[[Pieces], Columns], times: Pieces) -> float:
    """Return an upper bound, 0 at least, of values that are continuous within pieces.

    Between two neighbours a value exceeds the larger one by at most an eighth of the squared step times its curvature.
    The curvature is measured: the largest of the second differences around, and as much again as they differ, at least
    doubled, which covers a kink too. Steps whose bound exceeds the largest value by more than rounding are divided.
    """
    values, upper = evaluate(times), np.float64(0.0)
    largest = values.max(initial=0.0)
    begin, end, bounds = _step_bounds(times, values)
    for _ in range(OPTIONS.rounds):
        open_ = bounds > largest + np.maximum(OPTIONS.rounding, OPTIONS.share * largest)
        upper = np.maximum(upper, bounds[~open_].max(initial=0.0))
        begin, end, bounds = begin[open_], end[open_], bounds[open_]
        if not len(bounds):
            break
        order = np.argsort(-bounds)
        divided, others = order[: OPTIONS.divisions], order[OPTIONS.divisions :]
        times = np.linspace(begin[divided], end[divided], OPTIONS.steps + 1, axis=1)
        values = evaluate(times)
        largest = np.maximum(largest, values.max())
        parts = zip((begin, end, bounds), _step_bounds(times, values), strict=True)
        begin, end, bounds = (np.concatenate([whole[others], part]) for whole, part in parts)
    upper = np.max([upper, largest, bounds.max(initial=0.0)])
    return 0.0 if upper <= OPTIONS.rounding else float(upper)  # NaN if a value is


def _step_bounds(times: Pieces, values: Columns) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where every step begins and ends, and a bound of the values in it."""
    bends = np.pad(np.diff(values, 2, axis=1), ((0, 0), (2, 2), (0, 0)), mode="edge")
    around = sliding_window_view(bends, 4, axis=1)
    low, high = around.min(axis=-1), around.max(axis=-1)
    share = np.full((values.shape[1] - 1, 1), 1 / 4)
    share[[0, -1]] = 1 / 2  # at the ends of a piece only one second difference sees a kink
    bounds = np.maximum(values[:, :-1], values[:, 1:]) + share * (np.maximum(-low, 0.0) + high - low)
    return times[:, :-1].ravel(), times[:, 1:].ravel(), bounds.max(axis=-1, initial=0.0).ravel()


def differentiate_pieces(values: np.ndarray, steps: np.ndarray, order: int, *, cyclic: bool) -> np.ndarray:
    """Return derivatives of values (*batch, instants, columns) that are smooth between knots alone.

    Every interval has as many instants, its own ``steps`` apart. At a knot both sides' derivatives count the same.
    """
    count = (values.shape[-2] - 1) // len(steps)
    index = count * np.arange(len(steps))[:, None] + np.arange(count + 1)
    pieces = _difference_matrix(count + 1, order) @ values[..., index, :] / steps[:, None, None] ** order
    derivative = np.empty_like(values)
    derivative[..., :-1, :] = pieces[..., :-1, :].reshape(derivative[..., :-1, :].shape)
    derivative[..., -1, :] = pieces[..., -1, -1, :]
    inner = (pieces[..., :-1, -1, :] + pieces[..., 1:, 0, :]) / 2
    derivative[..., count:-1:count, :] = inner
    if cyclic:
        derivative[..., [0, -1], :] = (pieces[..., :1, 0, :] + pieces[..., -1:, -1, :]) / 2
    return derivative


@cache
def _difference_matrix(points: int, order: int) -> np.ndarray:
    """Return derivatives at evenly spaced points, one apart, of the polynomial through the nearest ones."""
    width = min(OPTIONS.width, points)
    first = np.clip(np.arange(points) - width // 2, 0, points - width)
    matrix = np.zeros((points, points))
    for i, begin in enumerate(first):
        offsets = np.arange(begin, begin + width) - float(i)
        right = np.zeros(width)
        right[order] = order  # of its factorial, the first or second
        matrix[i, begin : begin + width] = np.linalg.solve(np.vander(offsets, increasing=True).T, right)
    return read_only(matrix)

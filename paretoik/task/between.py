"""Motions between their samples: the projected curve on a finer grid."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from paretoik.arrays import read_only
from paretoik.task.motion import Motion
from paretoik.task.spline import Derivatives


@dataclass(frozen=True, kw_only=True)
class RefinementOptions:
    """How fine the grid is that motions are evaluated on between their samples.

    So many times finer: ``differences`` where finite differences are taken again, ``spline``, two at least, where the
    derivatives are those of the curve; ``width`` points of it are those of a difference of the correction.
    """

    differences: int = 4
    spline: int = 20
    width: int = 6


OPTIONS = RefinementOptions()


def finer_motion(motions: Motion, refinement: int | None = None) -> Motion:
    """Return the projected curves of motions (*batch, time, dof) of one task on a finer grid.

    With differences="spline" velocities and accelerations are those of the projected curve: the spline's own, and the
    differences of the small correction onto the path. Otherwise they are the motion's differences on the finer grid.

    Raises Infeasible where a motion leaves the path between its samples.
    """
    time = motions.time.reshape(-1, motions.time.shape[-1])[0]
    if motions.differences != "spline":
        even = np.linspace(0.0, time[-1], (refinement or OPTIONS.differences) * (len(time) - 1) + 1)
        return replace(motions, time=even, q=motions.at(even))
    count, step = refinement or OPTIONS.spline, np.diff(time)
    finer = np.append((time[:-1, None] + step[:, None] * np.arange(count) / count).ravel(), time[-1])
    q, (spline, dq, ddq, jerk) = motions.at(finer), motions.spline.at(finer)
    correction = q - spline
    dq = dq + differentiate_pieces(correction, step / count, 1, cyclic=motions.cyclic)
    ddq = ddq + differentiate_pieces(correction, step / count, 2, cyclic=motions.cyclic)
    derivatives = Derivatives(dq=dq, ddq=ddq, jerk=jerk, velocity_bounds=dq)
    return replace(motions, time=finer, q=q, derivatives=derivatives)


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

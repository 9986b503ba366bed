"""Motions between their samples: the projected curve on a finer grid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from paretoik.task.differences import first_derivative, second_derivative
from paretoik.task.motion import Motion
from paretoik.task.spline import Derivatives


@dataclass(frozen=True, kw_only=True)
class RefinementOptions:
    """How fine the grid is that motions are evaluated on between their samples.

    So many times finer: ``differences`` where finite differences are taken again, ``spline`` where the derivatives are
    those of the curve. Its kinks are at knots: the correction's differences are taken as near to them as ``near_knot``
    says, a share of a step of the grid.
    """

    differences: int = 4
    spline: int = 20
    near_knot: float = 0.25


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
    share = np.arange(count := refinement or OPTIONS.spline) / count
    near = OPTIONS.near_knot / count
    share = np.concatenate([[0.0, near], share[1:], [1 - near]])
    finer = np.append((time[:-1, None] + np.diff(time)[:, None] * share).ravel(), time[-1])
    q, (spline, dq, ddq, jerk) = motions.at(finer), motions.spline.at(finer)
    correction = q - spline
    if motions.cyclic:
        correction[..., -1, :] = correction[..., 0, :]
    dq = dq + first_derivative(correction, finer, "central", cyclic=motions.cyclic)
    ddq = ddq + _second_derivative(correction, finer, cyclic=motions.cyclic)
    index = np.arange(len(finer)) % (count + 2)
    on_grid = (index != 1) & (index != count + 1)
    dq, ddq, jerk = dq[..., on_grid, :], ddq[..., on_grid, :], jerk[..., on_grid, :]
    derivatives = Derivatives(dq=dq, ddq=ddq, jerk=jerk, velocity_bounds=dq)
    return replace(motions, time=finer[on_grid], q=q[..., on_grid, :], derivatives=derivatives)


def _second_derivative(values: np.ndarray, time: np.ndarray, *, cyclic: bool) -> np.ndarray:
    """Return second derivatives by central differences, at the ends continued linearly."""
    second = second_derivative(values, time, "central", cyclic=cyclic)
    if not cyclic:
        for end, near, next_near in ((0, 1, 2), (-1, -2, -3)):
            share = (time[near] - time[end]) / (time[next_near] - time[near])
            second[..., end, :] = (1 + share) * second[..., near, :] - share * second[..., next_near, :]
    return second

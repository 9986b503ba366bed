"""Motions between their samples: the projected curve on a finer grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paretoik.task.differences import first_derivative, second_derivative
from paretoik.task.motion import Motion
from paretoik.task.spline import Derivatives

INTERPOLANT_REFINEMENT = 4  # times finer: where finite differences are taken again
SPLINE_REFINEMENT = 10  # times finer: where the derivatives are those of the curve


def finer_motion(motions: Motion, refinement: int | None = None) -> Motion:
    """Return the projected curves of motions (*batch, time, dof) of one task on a finer grid.

    With differences="spline" velocities and accelerations are those of the projected curve: the spline's own, and the
    differences of the small correction onto the path. Otherwise they are the motion's differences on the finer grid.

    Raises Infeasible where a motion leaves the path between its samples.
    """
    time = motions.time.reshape(-1, motions.time.shape[-1])[0]
    if motions.differences != "spline":
        even = np.linspace(0.0, time[-1], (refinement or INTERPOLANT_REFINEMENT) * (len(time) - 1) + 1)
        return replace(motions, time=even, q=motions.at(even))
    count = refinement or SPLINE_REFINEMENT
    share = np.arange(count) / count
    finer = np.append((time[:-1, None] + np.diff(time)[:, None] * share).ravel(), time[-1])
    q, (spline, dq, ddq, jerk) = motions.at(finer), motions.spline.at(finer)
    correction = q - spline
    if motions.cyclic:
        correction[..., -1, :] = correction[..., 0, :]
    dq = dq + first_derivative(correction, finer, "central", cyclic=motions.cyclic)
    ddq = ddq + second_derivative(correction, finer, "central", cyclic=motions.cyclic)
    derivatives = Derivatives(dq=dq, ddq=ddq, jerk=jerk, velocity_bounds=dq)
    return replace(motions, time=finer, q=q, derivatives=derivatives)

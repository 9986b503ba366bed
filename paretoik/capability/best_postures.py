"""In which postures an arm is fastest or strongest: planar arms of three joints all around, others by ascent."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from paretoik.capability.actuation import Actuation
from paretoik.capability.compiled import actuators, planar_maxima
from paretoik.capability.joint_capability import Quantity
from paretoik.capability.posture_ascent import maximise_from
from paretoik.capability.posture_samples import (
    planar_reach_error,
    postures_error,
    sample_holdable_postures,
    sample_postures_at,
)
from paretoik.robot.arm import Arm

TILT_TOLERANCE = 1e-12  # of 1 − cos: a base tilted less leaves an arm planar


def best_postures(
    arm: Arm,
    actuation: Actuation,
    position: Float[np.ndarray, " task"],
    directions: Float[np.ndarray, "directions task"],
    quantity: Quantity,
    *,
    samples: int,
    rng: np.random.Generator,
) -> Float[np.ndarray, "directions dof"]:
    """Return for each direction the posture at a position in which speed or force along it is greatest.

    Raises OutOfReach and Infeasible as ``directional_maxima`` does.
    """
    table = _planar_table(arm)
    if table is None:
        starts = sample_holdable_postures(arm, actuation, position, samples, rng)
        return maximise_from(arm, actuation, position, directions, quantity, starts)
    values, q = np.empty(len(directions)), np.empty((len(directions), arm.dof))
    maximised = actuators.SPEED if quantity == "velocity" else actuators.HOLD
    if not planar_maxima.write_maxima((table, actuation.table, position, maximised), directions, values, q):
        raise planar_reach_error(table, position)
    if (values < 0).any():
        postures = sample_postures_at(arm, position, min(samples, 400), rng)
        raise postures_error(arm, actuation, postures, position)
    return q


@lru_cache(maxsize=64)
def _planar_table(arm: Arm) -> tuple[np.ndarray, ...] | None:
    """Return what ``planar_maxima`` reads of an arm; None unless it is planar with three turning joints."""
    upright = abs(arm.base.rotation[2, 2] - 1.0) <= TILT_TOLERANCE
    if not (arm.is_planar and arm.dof == 3 and arm.periodic.all() and upright):
        return None
    steps = [arm.placements[1].position, arm.placements[2].position, arm.tool.position]
    lengths = np.array([np.hypot(step[0], step[1]) for step in steps])
    if not (lengths > 0).all():
        return None
    turned = np.array([np.arctan2(pose.rotation[1, 0], pose.rotation[0, 0]) for pose in arm.placements])
    offsets = np.array([np.arctan2(step[1], step[0]) for step in steps])
    first = arm.base.position + arm.base.rotation @ arm.placements[0].position
    base_angle = np.arctan2(arm.base.rotation[1, 0], arm.base.rotation[0, 0])
    weights = np.array([[body.mass, *body.center[:2]] for body in arm.bodies] + [[*arm.gravity[:2], 0.0]])
    return lengths, turned, offsets, np.array([first[0], first[1], base_angle]), weights, np.array(arm.position_limits)

"""Directional maxima: highest speed or greatest force in every direction.

Source: Kim, Choi & Jang 2021, section 2, and Kim, Shin & Jang 2021.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import get_args

import numpy as np
from jaxtyping import Float

from paretoik.capability import actuator_kernels as actuators
from paretoik.capability import planar_maxima
from paretoik.capability.actuation import Actuation, DistributedActuation, check_actuation
from paretoik.capability.joint_capability import (
    Quantity,
    fastest_joint_speeds,
    greatest_forces,
    joint_speeds,
    motor_speeds,
    torque_capacity,
)
from paretoik.capability.postures import maximise_from, postures_error, sample_holdable_postures, sample_postures_at
from paretoik.errors import InvalidInput, OutOfReach
from paretoik.inputs import check_choice, check_seed, check_size, finite_array
from paretoik.robot import kinematics
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import gravity_torques
from paretoik.tables import represented


@lru_cache(maxsize=64)
def _planar_table(arm: Arm) -> tuple[np.ndarray, ...] | None:
    """Return an arm's data for ``planar_maxima``, None unless it has three links that turn in the x-y plane."""
    upright = abs(arm.base.rotation[2, 2] - 1.0) <= 1e-12  # 1 − cos of the tilt
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


# Directional maxima of a tool at a position.


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class PerformancePolygon:
    """Highest speeds or forces of an arm at one position, along each direction.

    position: position (task,) of the tool [m]; task is 2 for planar arms, else 3
    directions: unit vectors (directions, task)
    values: speeds [m/s] or forces [N] (directions,) along the directions
    q: postures (directions, dof), one per direction [rad, m]
    dq: joint velocities (directions, dof) [rad/s, m/s]; 0 for forces
    torque: torques (directions, dof) of the joints [N m, N]
    motor_speeds: speeds (directions, motors, dof) of the joints' motors (motors = 1) or of front and back sliders (2)
    motor_efforts: efforts (directions, motors, dof) of the same motors [N m, N]
    sliders: positions of front and back sliders (directions, 2, dof) [m]; None without sliders
    """

    arm: Arm
    actuation: Actuation
    quantity: Quantity
    position: Float[np.ndarray, " task"]
    directions: Float[np.ndarray, "directions task"]
    values: Float[np.ndarray, " directions"]
    q: Float[np.ndarray, "directions dof"]
    dq: Float[np.ndarray, "directions dof"]
    torque: Float[np.ndarray, "directions dof"]
    motor_speeds: Float[np.ndarray, "directions motors dof"]
    motor_efforts: Float[np.ndarray, "directions motors dof"]
    sliders: Float[np.ndarray, "directions 2 dof"] | None

    def __len__(self) -> int:
        return len(self.values)

    @property
    def vertices(self) -> Float[np.ndarray, "directions task"]:
        """Maxima as vectors [m/s, N]."""
        return self.values[:, None] * self.directions


@dataclass(frozen=True, kw_only=True, eq=False)
class DirectionalQuery:
    """Checked arguments of ``paretoik.directional_maxima``; ``directions`` are unit vectors."""

    arm: Arm
    actuation: Actuation
    quantity: Quantity
    position: Float[np.ndarray, " task"]
    directions: Float[np.ndarray, "directions task"]
    starts: int
    seed: int


def directional_query(
    arm: Arm, actuation: Actuation, position: object, directions: object, *, quantity: Quantity, starts: int, seed: int
) -> DirectionalQuery:
    """Return the checked arguments. Raises InvalidInput, naming the argument that cannot be used."""
    check_actuation(actuation, arm)
    check_choice("quantity", quantity, get_args(Quantity))
    check_size("starts", starts, 1)
    check_seed("seed", seed)
    task = 2 if arm.is_planar else 3
    return DirectionalQuery(
        arm=arm,
        actuation=actuation,
        quantity=quantity,
        position=finite_array("position", position, (task,)),
        directions=unit_directions(directions, task),
        starts=starts,
        seed=seed,
    )


def performance_polygon(query: DirectionalQuery) -> PerformancePolygon:
    """Return the requested maxima. Raises OutOfReach, SolverFailed and Infeasible as the verb does."""
    arm, actuation, quantity, directions = query.arm, query.actuation, query.quantity, query.directions
    position, rng, table = query.position, np.random.default_rng(query.seed), _planar_table(arm)
    # The best posture of each direction: planar arms of three joints search all postures, others ascend from starts.
    if table is None:
        starts = sample_holdable_postures(arm, actuation, position, query.starts, rng)
        q = maximise_from(arm, actuation, position, directions, quantity, starts)
    else:
        values, q = np.empty(len(directions)), np.empty((len(directions), arm.dof))
        maximised = actuators.SPEED if quantity == "velocity" else actuators.HOLD
        if not planar_maxima.write_maxima((table, actuation.table, position, maximised), directions, values, q):
            lengths, base = table[0], table[3][:2]
            shortest = max(0.0, 2 * float(lengths.max()) - float(lengths.sum()))
            raise OutOfReach(
                f"position: {position.tolist()} m is {np.linalg.norm(position - base):.10g} m from the first joint; "
                f"the arm reaches from {shortest:.10g} m to {float(lengths.sum()):.10g} m",
                sample=0,
            )
        if (values < 0).any():
            postures = sample_postures_at(arm, position, min(query.starts, 400), rng)
            raise postures_error(arm, actuation, postures, position)
    columns, torque = kinematics.jacobian(arm, q)[:, : len(position), :], gravity_torques(arm, q)
    if quantity == "velocity":
        speeds = joint_speeds(actuation, q, torque)
        values, dq = fastest_joint_speeds(columns, speeds.low, speeds.high, directions)
        front = np.where(dq >= 0, speeds.front_high, speeds.front_low)
        speed, effort = motor_speeds(actuation, q, front, torque, dq)
    else:
        capacity, front = torque_capacity(actuation, q)
        values = greatest_forces(columns, -capacity - torque, capacity - torque, directions[:, None])[:, 0]
        force = directions * np.where(np.isfinite(values), values, 0.0)[:, None]
        torque, dq = torque + np.einsum("kaj,ka->kj", columns, force), np.zeros_like(q)
        effort = actuation.ratios(q, front) * torque[:, None]
        speed = np.zeros_like(effort)
    sliders = None
    if isinstance(actuation, DistributedActuation):
        sliders = np.stack([front, actuation.gears(q, front)[0]], axis=1)
    return PerformancePolygon(
        arm=arm,
        actuation=actuation,
        quantity=quantity,
        position=position,
        directions=directions,
        values=values,
        q=q,
        dq=dq,
        torque=torque,
        motor_speeds=speed,
        motor_efforts=effort,
        sliders=sliders,
    )


def unit_directions(directions: object, task: int) -> Float[np.ndarray, "directions task"]:
    """Return this number of evenly spread unit vectors, or the given ``directions`` scaled to length 1."""
    if isinstance(directions, int | np.integer) and not isinstance(directions, bool):
        check_size("directions", directions, 1)
        share = (np.arange(directions) + 0.5 * (task == 3)) / directions
        if task == 2:
            return np.stack([np.cos(2 * np.pi * share), np.sin(2 * np.pi * share)], axis=1)
        height, turn = 1 - 2 * share, np.pi * (1 + np.sqrt(5)) * np.arange(directions)  # a spiral from pole to pole
        around = np.sqrt(1 - height**2)
        return np.stack([around * np.cos(turn), around * np.sin(turn), height], axis=1)
    vectors = finite_array("directions", directions)
    if vectors.ndim != 2 or vectors.shape[1] != task or not len(vectors):
        fact = f"{directions!r}" if vectors.ndim == 0 else f"shape {vectors.shape}"
        raise InvalidInput(
            f"directions must be a whole number or vectors (directions, {task}), at least one, got {fact}"
        )
    size = np.abs(vectors).max(axis=1, keepdims=True)
    vectors = vectors / np.where(size > 0, size, 1.0)  # scaled first, because squares may overflow or underflow
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not length.all():
        raise InvalidInput(f"directions must be longer than 0, got length 0 at index {int(np.argmin(length))}")
    return vectors / length

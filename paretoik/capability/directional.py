"""Directional maxima: how fast a tool can go, or how hard it can push, in every direction from a position.

Source: Kim, Choi & Jang 2021, section 2, and Kim, Shin & Jang 2021.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

import numpy as np
from jaxtyping import Float

from paretoik.capability.actuation import Actuation, DistributedActuation, check_actuation
from paretoik.capability.best_postures import best_postures
from paretoik.capability.joint_capability import Quantity, joint_speeds, motor_speeds, torque_capacity
from paretoik.capability.posture_maxima import fastest_joint_speeds, greatest_forces
from paretoik.errors import InvalidInput, check_size
from paretoik.inputs import finite_array
from paretoik.robot import kinematics
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import gravity_torques


@dataclass(frozen=True, kw_only=True, eq=False)
class PerformancePolygon:
    """The highest speeds or forces of an arm along each direction from a position, and how they are reached.

    ``values`` (directions,) are speeds [m/s] or forces [N] along ``directions`` (directions, task), unit vectors, from
    ``position`` (task,) [m]; task is 2 for planar arms, else 3. Each has its own posture ``q`` (directions, dof), joint
    velocities ``dq`` (0 for forces) and ``torque``; ``motor_speeds`` and ``motor_efforts`` (directions, motors, dof)
    are of the joints' motors (motors = 1), or of front and back ``sliders`` (directions, 2, dof) [m] (motors = 2;
    None without).
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
        """The maxima as vectors [m/s, N]."""
        return self.values[:, None] * self.directions


def directional_maxima(
    arm: Arm,
    actuation: Actuation,
    position: object,
    directions: object = 16,
    *,
    quantity: Quantity = "velocity",
    starts: int = 20_000,
    seed: int = 0,
) -> PerformancePolygon:
    """Return the highest speeds or forces of an arm along each direction while its tool is at a position.

    Speeds are those with which motors can hold the arm against gravity meanwhile (quasi-static); forces are those the
    tool can exert at rest, in postures that can be held without them. In a posture with its sliders both are exact: a
    closed form, the facet of a zonotope (a linear program gives the same). Sliders are searched where they can bear
    their load, in 12 pieces of each stretch and by golden sections.

    Postures of planar arms with three joints are evaluated on every branch, all around, at 360 places on each curve and
    wherever limits begin or end to hold, and searched by golden sections from there: one of two maxima within a degree
    may be missed. Other arms ascend from several of ``starts`` postures, over posture, sliders and speeds at once, by
    interior points, until the best value was reached often: no proof.

    These are speeds of an instant: the next may have left the posture that allows them. Sliders near a toggle turn
    joints fast for a short way, and each direction has a posture and gears of its own. ``PointToPoint`` counts the way
    there.

    Parameters
    ----------
    arm, actuation
        The arm, its gravity as it is mounted, and its motors.
    position
        Of the tool, (2,) for planar arms, else (3,) [m].
    directions
        How many, evenly around from the x axis (Eq. 2) or over the sphere; or vectors (directions, task), however long.
    quantity
        "velocity" or "force".
    starts, seed
        Postures to start from (more are drawn where few can be held), and the seed of their chance; planar arms with
        three joints need none.

    Raises InvalidInput naming what cannot be used; OutOfReach where no posture reaches the position, SolverFailed where
    none was found that does; Infeasible where none was found that can be held, naming the joint, its torque and what
    its motor can hold, or the rod's angle, of the best one. Source: Kim, Choi & Jang 2021, Eq. 1.
    """
    check_actuation(actuation, arm)
    if quantity not in get_args(Quantity):
        raise InvalidInput(f"quantity must be one of {', '.join(get_args(Quantity))}, got {quantity!r}")
    check_size("starts", starts, 1)
    check_size("seed", seed, 0)
    task = 2 if arm.is_planar else 3
    place = finite_array("position", position, (task,))
    vectors = unit_directions(directions, task)
    rng = np.random.default_rng(seed)
    q = best_postures(arm, actuation, place, vectors, quantity, samples=starts, rng=rng)
    return _polygon(arm, actuation, quantity, place, vectors, q)


def unit_directions(directions: object, task: int) -> Float[np.ndarray, "directions task"]:
    """Return unit vectors: as many as a number says, or ``directions`` brought to length 1.

    Raises InvalidInput for what is neither.
    """
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
            f"directions: a whole number, or vectors (directions, {task}), at least one, wanted, got {fact}"
        )
    size = np.abs(vectors).max(axis=1, keepdims=True)
    vectors = vectors / np.where(size > 0, size, 1.0)  # their squares may be too large or too small
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not length.all():
        raise InvalidInput(f"directions: vectors longer than 0 wanted, got one of 0 at index {int(np.argmin(length))}")
    return vectors / length


def _polygon(
    arm: Arm, actuation: Actuation, quantity: Quantity, position: np.ndarray, directions: np.ndarray, q: np.ndarray
) -> PerformancePolygon:
    """Return the maxima in postures, one a direction, with what every motor does."""
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

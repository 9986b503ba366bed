"""A motion's quantities at a sample in CasADi's symbols: objectives' shares, limited values, and the tool's error.

The dynamics are our component kernels fed with symbols, which fold zeros away; those of a planar arm are in lean closed
form: in absolute link angles the inertia is A_ij cos(φ_i - φ_j), which needs few sines and cosines. Absolute values are
slack variables, one per joint and sample, above both signs; peaks are epigraph variables, one per motion, above both
signs of every joint at all samples.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi
import numpy as np
from casadi import SX, vertcat

from paretoik.robot import dynamics
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import frame_components, link_frames
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective

SLACK = 1e-3  # W above the power, to start from


def slacks(task: MotionTask) -> int:
    """Return the number of slack variables of a sample."""
    return task.arm.dof if any(objective.name == "mechanical_energy" for objective in task.objectives) else 0


def above_power(task: MotionTask, q: np.ndarray) -> np.ndarray:
    """Return slack variables (samples, slacks) above a motion's powers."""
    return np.abs(task.motion(q).power[:, : slacks(task)]) + SLACK


def peaks(task: MotionTask) -> list[Objective]:
    """Return the objectives that are peaks."""
    return [objective for objective in task.objectives if objective.form == "peak"]


def is_rated(task: MotionTask) -> bool:
    """Return whether torques, and so accelerations, count."""
    names = {objective.name for objective in task.objectives}
    return bool(
        {"torque_norm", "mechanical_energy", "peak_torque", "peak_power"} & names
        | {"torque", "power"} & set(task.bounds)
    )


def check(task: MotionTask, differences: str) -> None:
    """Refuse a task that peers' programs cannot state."""
    assert task.differences == differences, f"differences must be {differences!r}, got {task.differences!r}"
    assert task.start is None, "start must be free, got a given one"
    others = [*task.obstacles, *task.constraints, *(["a stop"] if task.ends_at_rest else [])]
    assert not others, f"limits must be on joints only, got {others}"
    assert set(task.bounds) <= {"position", "velocity", "torque", "power"}, f"got limits {', '.join(task.bounds)}"


def planar_coupling(arm: Arm) -> np.ndarray | None:
    """Return the symmetric A with M_ij = A_ij cos(φ_i - φ_j) [kg m²] of a planar arm without gravity, or None."""
    lengths = np.array([place.position[0] for place in (*arm.placements[1:], arm.tool)])
    masses = np.array([body.mass for body in arm.bodies])
    centers = np.array([body.center[0] for body in arm.bodies])
    outer = np.append(np.cumsum(masses[::-1])[::-1][1:], 0.0)
    upper = np.triu(np.outer(lengths, masses * centers + outer * lengths), 1)
    own = np.array([body.inertia[2, 2] for body in arm.bodies]) + masses * centers**2 + outer * lengths**2
    A = upper + upper.T + np.diag(own)
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, 8, arm.dof))  # does it compute this arm's torques?
    phi, rate, change = (np.cumsum(each, axis=1) for each in (q, dq, ddq))
    angle = phi[:, :, None] - phi[:, None]
    force = np.einsum("ij,nij,nj->ni", A, np.cos(angle), change) + np.einsum("ij,nij,nj->ni", A, np.sin(angle), rate**2)
    torque = np.cumsum(force[:, ::-1], axis=1)[:, ::-1]
    return A if np.allclose(torque, dynamics.inverse_dynamics(arm, q, dq, ddq), rtol=1e-10) else None


def energy_and_torque(arm: Arm) -> Callable[[Any, Any, Any], tuple[Any, Any]]:
    """Return a function of SX vectors q, rate and acceleration: kinetic energy, and torques of the joints."""
    A = planar_coupling(arm)

    def spatial(q: Any, rate: Any, acceleration: Any) -> tuple[Any, Any]:
        here, v, a = (casadi.vertsplit(one) for one in (q, rate, acceleration))
        return dynamics.energy_components(arm, here, v)[0], vertcat(*dynamics.torque_components(arm, here, v, a))

    def planar(q: Any, rate: Any, acceleration: Any) -> tuple[Any, Any]:
        assert A is not None
        w, change, n = casadi.cumsum(rate), casadi.cumsum(acceleration), arm.dof
        energy, force = casadi.dot(np.diag(A), w**2) / 2, [A[i, i] * change[i] for i in range(n)]
        for i in range(n):
            angle = SX(0)
            for j in range(i + 1, n):
                angle += q[j]  # φ_j - φ_i
                cosine, sine = A[i, j] * casadi.cos(angle), A[i, j] * casadi.sin(angle)
                energy += cosine * w[i] * w[j]
                force[i] += cosine * change[j] - sine * w[j] ** 2
                force[j] += cosine * change[i] + sine * w[i] ** 2
        return energy, vertcat(*(sum(force[i:]) for i in range(n)))

    return spatial if A is None else planar


def at_sample(
    task: MotionTask, q: Any, rate: Any, acceleration: Any, slack: Any, top: Any = None, *, bounded_rates: bool = False
) -> tuple[Any, Any]:
    """Return a sample's shares of objectives and limited values, from SX vectors (dof,), (slacks,), (peaks,).

    Velocities are no limited values if they have bounds of their own.
    """
    arm = task.arm
    energy, torque = energy_and_torque(arm)(q, rate, acceleration)
    lower, upper = arm.position_limits.T
    limited = np.isfinite(upper - lower) & (upper > lower)
    ratio: Any = vertcat(*(q[int(i)] - (lower[i] + upper[i]) / 2 for i in np.flatnonzero(limited)))
    worth: dict[str, Any] = {
        "kinetic_energy": lambda: energy,
        "torque_norm": lambda: casadi.sumsqr(torque),
        "mechanical_energy": lambda: casadi.sum1(slack),
        "joint_limit_distance": lambda: (
            casadi.sumsqr(ratio / (upper - lower)[limited]) / (2 * arm.dof) / float(task.times[-1] - task.times[0])
        ),
    }
    quantities = {"velocity": rate, "torque": torque, "power": torque * rate}
    shares: Any = vertcat(*(SX(0) if each.form == "peak" else worth[each.name]() for each in task.objectives))
    rows = [quantities[kind] for kind in limited_kinds(task, bounded_rates=bounded_rates)]
    if slacks(task):
        rows += [slack - quantities["power"], slack + quantities["power"]]
    for i, objective in enumerate(peaks(task)):
        below = quantities[objective.name.removeprefix("peak_")]
        rows += [top[i] - below, top[i] + below]
    return shares, vertcat(*rows) if rows else SX(0, 1)


def limited_kinds(task: MotionTask, *, bounded_rates: bool) -> list[str]:
    """Return the kinds of limits that are rows of a sample."""
    return [kind for kind in ("velocity", "torque", "power")[bounded_rates:] if kind in task.bounds]


def limited_sides(task: MotionTask, *, bounded_rates: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of the limited values of ``at_sample``."""
    kinds = limited_kinds(task, bounded_rates=bounded_rates)
    lower, upper = (
        np.concatenate([np.empty(0), *(task.bounds[kind][0][:, side] for kind in kinds)]) for side in (0, 1)
    )
    both = 2 * (slacks(task) + task.arm.dof * len(peaks(task)))
    return np.concatenate([lower, np.zeros(both)]), np.concatenate([upper, np.full(both, np.inf)])


def sides_of(task: MotionTask, kind: str, times: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of a quantity of all joints at a number of times; infinite if the task has none."""
    bounds = task.bounds[kind][0] if kind in task.bounds else np.tile([-np.inf, np.inf], (task.arm.dof, 1))
    return np.tile(bounds[:, 0], times), np.tile(bounds[:, 1], times)


def pose_function(task: MotionTask) -> Any:
    """Return a function of a posture and its target: the error of the tool."""
    (only,) = task.tasks
    q: Any = SX.sym("q", task.arm.dof)
    target: Any = SX.sym("target", task.targets.shape[1])
    joints: Any = casadi.vertsplit(q)
    rotation, position = frame_components(task.arm, link_frames(task.arm, joints), task.arm.frame(only.frame))
    size = only.position_rows
    off: Any = vertcat(*position[:size]) - target[:size]
    if target.numel() > size:
        turned: Any = casadi.reshape(target[size:], 3, 3) @ vertcat(*(casadi.horzcat(*row) for row in rotation))
        if only.axes == "xyz+z-axis":
            off = vertcat(off, turned[0, 2], turned[1, 2])
        else:
            off = vertcat(off, turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1])
    return casadi.Function("pose", [q, target], [off])

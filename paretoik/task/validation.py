"""Checks of all parts of a motion problem, which make the motion task."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import get_args

import numpy as np
from jaxtyping import Float

from paretoik.collision.obstacles import Obstacle, describe_obstacle, radius_of, signed_distance
from paretoik.errors import InvalidInput
from paretoik.inputs import (
    ArrayLike,
    check_choice,
    check_flag,
    check_instance,
    degrees_hint,
    finite_number,
    read_list,
    real_array,
    shown,
)
from paretoik.robot.arm import Arm, check_arm
from paretoik.robot.kinematics import characteristic_length, link_nodes
from paretoik.robot.pose import matrix_to_quaternion, quaternion_to_matrix
from paretoik.task.differences import DIFFERENCES, Differences
from paretoik.task.limits import LIMIT_TOLERANCE, Constraint, Limits
from paretoik.task.motion import check_obstacles, checked_link_radius
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective, evaluate_function
from paretoik.task.path import Path
from paretoik.task.retraction import row_scales, task_errors
from paretoik.task.task import Task, row_units

START_TOLERANCE = 1e-6  # share of the arm's length, and rad: largest distance of a start from the path


def motion_task(
    arm: Arm,
    tasks: Path | Task | Sequence[Path | Task],
    *,
    objectives: Sequence[Objective],
    limits: Limits | None = None,
    constraints: Sequence[Constraint] = (),
    obstacles: Sequence[Obstacle] = (),
    link_radius: ArrayLike = 0.0,
    differences: Differences = DIFFERENCES,
    redundant: bool = True,
) -> MotionTask:
    """Check all parts of a problem; return its motion task, with free start and end.

    redundant: True to refuse tasks that leave no joint free

    Raises InvalidInput, naming the unusable part.
    """
    check_arm("arm", arm)
    check_choice("differences", differences, get_args(Differences))
    followed = _followed_tasks(arm, tasks, redundant=redundant)
    _check_decorated("objective", objectives, Objective)
    _check_decorated("constraint", constraints, Constraint)
    if not objectives:
        raise InvalidInput("objectives must be at least one, got none")
    given = Limits() if limits is None else limits
    check_instance("limits", given, Limits, "Limits(...)")
    check_obstacles(obstacles)
    radius = checked_link_radius(link_radius, arm)
    bounds = given.bounds(arm, followed[0].path.samples)
    allowed = bounds.get("position", np.tile([-np.inf, np.inf], (1, arm.dof, 1)))
    widest = np.stack([allowed[..., 0].min(axis=0), allowed[..., 1].max(axis=0)], axis=-1)
    arm = replace(arm, position_limits=widest)
    if lacks_masses(arm):
        for kind in ("torque", "power"):
            if getattr(given, kind) is not None and np.isfinite(given.bounds(arm, 3).get(kind, np.inf)).any():
                raise InvalidInput(f"{kind} limit: the arm must have masses, got {arm.name}, which has massless links")
        bounds.pop("torque", None)  # the arm's own limit is left out: torques are unknown without masses
    task = MotionTask(
        arm=arm,
        tasks=followed,
        objectives=tuple(objectives),
        constraints=tuple(constraints),
        bounds=bounds,
        obstacles=tuple(obstacles),
        link_radius=radius,
        min_clearance=given.clearance,
        start=None,
        ends_at_rest=False,
        cyclic=False,
        differences=differences,
    )
    _check_immovable_links(task)
    if lacks_masses(arm):
        _check_functions_without_masses(task)
    return task


def _check_plane(arm: Arm, task: Task) -> None:
    """Raise InvalidInput if a path without axes leaves a planar arm's plane. Poses with z = 0 are accepted."""
    if not arm.is_planar:
        return
    normal, largest_tilt = arm.base.rotation[:, 2], 1e-4  # rad: twice the error of angles with four decimals
    if abs(normal[2]) < largest_tilt:
        raise InvalidInput(
            f"path: the plane of {arm.name} must not be vertical, as paths are in x and y, got the normal "
            f"({_coordinates(normal)}); a horizontal one with mounted(gravity=(0, -9.81, 0)) has the same torques"
        )
    path, points = task.path, task.path.positions
    if task.axes is not None or points.shape[1] == 2:
        return
    frame = arm.pose(np.zeros(arm.dof), frame=task.frame)
    tolerance = START_TOLERANCE * characteristic_length(arm)
    is_level = float(np.hypot(*normal[:2])) <= largest_tilt
    plane = f"the plane z = {_coordinates(frame.position[2:])} m of {arm.name}"
    if not is_level:
        through = f"through ({_coordinates(frame.position)}) m with the normal ({_coordinates(normal)})"
        plane = f"the plane of {arm.name}, {through}"
    wish = f"path must have {'points' if path.quaternions is None else 'poses'} in {plane}"
    if path.quaternions is not None:
        # Poses must be the frame, turned about the normal of the plane. The tilt is the rotation RᵀR_d without its part
        # about the normal (swing and twist). The angle of "xy+angle" is about the z axis of the frame, which must not
        # be in the plane.
        axis = frame.rotation.T @ arm.base.rotation[:, 2]
        relative = matrix_to_quaternion(frame.rotation.T @ quaternion_to_matrix(path.quaternions))
        twist = relative[:, 1:] @ axis
        swing = np.linalg.norm(relative[:, 1:] - twist[:, None] * axis, axis=1)
        tilt = 2.0 * np.arctan2(swing, np.hypot(relative[:, 0], twist)).max()
        if tilt > largest_tilt:
            raise InvalidInput(f"{wish}, or axes='xy', got a pose tilted by {tilt:.3g} rad")
        if abs(axis[2]) < largest_tilt:
            raise InvalidInput(f"{wish}, with z axes that are not in it, or axes='xy', got z axes in it")
    distance = (points - frame.position) @ (np.sign(normal[2]) * normal)
    at_zero = path.quaternions is not None and is_level and np.abs(points[:, 2]).max() <= tolerance
    if not at_zero and np.abs(distance).max() > tolerance:
        axes = "xy" if path.quaternions is None else "xy+angle"
        raise InvalidInput(f"{wish}, or axes={axes!r}, got one {distance[np.abs(distance).argmax()]:.3g} m off it")


def _coordinates(vector: Float[np.ndarray, " coordinates"]) -> str:
    """Return coordinates as text, without the sign of rounded zeros."""
    return ", ".join(f"{round(value, 12) + 0.0:.6g}" for value in vector.tolist())


def _followed_tasks(arm: Arm, given: Path | Task | Sequence[Path | Task], *, redundant: bool) -> tuple[Task, ...]:
    """Return the checked tasks, each with its axes."""
    every = []
    for one in given if isinstance(given, list | tuple) else [given]:
        if not isinstance(one, Path | Task):
            raise InvalidInput(f"path must be a Path, a Task or a list of these, got {shown(one)}")
        every.append(Task(one) if isinstance(one, Path) else one)
    tasks = tuple(one.resolve_axes(arm) for one in every)
    for one in every:
        _check_plane(arm, one)
    if not tasks:
        raise InvalidInput("path must have at least one path or task, got none")
    times = tasks[0].path.times
    for i, task in enumerate(tasks[1:], start=2):
        if not np.array_equal(task.path.times, times):
            raise InvalidInput(f"task {i}: must be sampled at the same times as task 1")
    rows = sum(task.rows for task in tasks)
    if rows > arm.dof - redundant:
        raise InvalidInput(
            f"path: {arm.name} must have at least {rows + redundant} joints for {rows} equations, got {arm.dof}; "
            "drop axes or add joints"
        )
    return tasks


def _check_immovable_links(task: MotionTask) -> None:
    """Raise InvalidInput if an obstacle overlaps the base, another link that no joint moves, or an end that stays."""
    if not task.obstacles:
        return
    lower, upper = task.arm.position_limits.T
    lower = np.where(np.isfinite(lower), lower, 0.0)
    upper = np.where(np.isfinite(upper), upper, lower + 1.0)
    shares = (np.sin(np.arange(1.0, 4.0 * task.arm.dof + 1.0)).reshape(4, task.arm.dof) + 1) / 2
    nodes = link_nodes(task.arm, lower + shares * (upper - lower))
    still = np.linalg.norm(np.ptp(nodes, axis=0), axis=1) <= LIMIT_TOLERANCE * characteristic_length(task.arm)
    smallest = min(task.min_clearance, 0.0) - LIMIT_TOLERANCE * task.clearance_range
    for link in np.flatnonzero(still[:-1] | still[1:]).tolist():
        radius, ends = radius_of(task.link_radius, link), [end for end in (link, link + 1) if still[end]]
        for number, obstacle in enumerate(task.obstacles):
            distance = float(signed_distance(obstacle, nodes[0, ends[0]], nodes[0, ends[-1]])) - radius
            if distance < smallest:
                part = f"link {link}, which no joint moves" if link else "the base, which does not move"
                part = part if len(ends) == 2 else f"the end of link {link} that no joint moves"
                links = "links have" if isinstance(task.link_radius, float) else "it has"
                raise InvalidInput(
                    f"obstacles: {describe_obstacle(task.obstacles, number)}, must be clear of {part}, got "
                    f"one that reaches {-distance:.3g} m into it ({links} a radius of {radius:g} m): no "
                    "motion can keep clear of it"
                )


def _check_decorated(kind: str, members: Sequence[Objective] | Sequence[Constraint], required: type) -> None:
    wish = f"a list of functions decorated with @{kind}"
    wish += ", or the library's, such as pk.kinetic_energy" if required is Objective else ""
    names = [member.name for member in read_list(f"{kind}s", members, required, wish)]
    if len(set(names)) != len(names):
        raise InvalidInput(f"{kind}s: names must differ, got {', '.join(names)}")


def lacks_masses(arm: Arm) -> bool:
    """Return whether no link has mass, or whether a link of a URDF before the last has none."""
    masses = [body.mass for body in arm.bodies]
    return not any(masses) or (arm.source is not None and not all(masses[:-1]))


def _check_functions_without_masses(task: MotionTask) -> None:
    """Raise InvalidInput for an objective or constraint of torques or energies."""
    q = np.linspace(0.1, 0.7, len(task.times) * task.arm.dof).reshape(1, len(task.times), task.arm.dof)
    motion = task.motion(q)
    for name in ("torque", "power", "kinetic_energy"):
        values = np.full_like(getattr(motion, name), np.nan)
        motion.__dict__[name] = values  # these values replace the computed ones
    for kind, members in (("objective", task.objectives), ("constraint", task.constraints)):
        for member in members:
            try:
                values = evaluate_function(member.name, member.function, motion, member.form)
            except Exception:  # users' functions may raise anything, here or later
                continue
            if np.isnan(values).all():
                raise InvalidInput(
                    f"{kind} {member.name}: the arm must have masses, got {task.arm.name}, which has massless links"
                )


def with_ends(
    task: MotionTask, *, start: object = "free", end_velocity: float | None = None, cyclic: bool = False
) -> MotionTask:
    """Return the task with a given [rad, m] or free start, and an end that is free, at rest or equal to the start.

    Raises InvalidInput for an impossible end, and if the start is off the first sample or beyond limits.
    """
    check_flag("cyclic", cyclic)
    arm, rests = task.arm, end_velocity is not None
    if rests and finite_number("end_velocity", end_velocity) != 0:
        raise InvalidInput(f"end_velocity must be 0 or None (free), got {shown(end_velocity)}")
    if rests and cyclic:
        raise InvalidInput("end_velocity must be None if cyclic=True, got 0")
    if cyclic and not all(each.path.is_closed for each in task.tasks):
        raise InvalidInput("path must be closed if cyclic=True, got one that does not end where it starts")
    for path in [each.path for each in task.tasks] if rests else []:
        # the speed in the last 0.01 % of the path must be below 1 % of its mean
        instants = np.array([1.0 - 1e-4, 1.0]) * path.duration
        end = np.linalg.norm(np.diff(path.at(instants)[0], axis=0)) / np.diff(instants)[0]
        mean = np.linalg.norm(np.diff(path.positions, axis=0), axis=1).sum() / path.duration
        if end > 0.01 * mean:
            raise InvalidInput(f"path must come to rest if end_velocity=0, got one that ends at {end:.3g} m/s")
    task = replace(task, ends_at_rest=rests, cyclic=cyclic)
    if isinstance(start, str) and start == "free":
        return task
    if start is None or isinstance(start, str):
        raise InvalidInput(f"start must be 'free' or {arm.dof} joint positions, got {shown(start)}")
    q = real_array("start", start)
    if q.shape != (arm.dof,) or not np.all(np.isfinite(q)):
        raise InvalidInput(f"start must be 'free' or {arm.dof} finite joint positions, got {shown(start)}")
    error = np.abs(task_errors(arm, task.tasks, q, task.targets[0])[0])
    scales = row_scales(arm, task.tasks)
    worst = int(np.argmax(error / scales))
    if error[worst] > START_TOLERANCE * scales[worst]:
        unit, hint = row_units(task.tasks)[worst], degrees_hint(q[arm.periodic])
        raise InvalidInput(
            f"start must be at most {START_TOLERANCE * scales[worst]:.3g} {unit} off the path's first sample, got "
            f"{error[worst]:.3g} {unit}{hint and f'; {hint}'}"
        )
    if "position" in task.bounds:
        lower, upper = task.bounds["position"][0].T
        for j in np.flatnonzero((q < lower) | (q > upper)):
            within = f"{lower[j]:.6g} to {upper[j]:.6g}"
            raise InvalidInput(f"start: {arm.joint_names[j]} must be within its limits {within}, got {q[j]:.6g}")
    return replace(task, start=q)

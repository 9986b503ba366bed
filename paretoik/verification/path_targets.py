"""Tool targets, computed again from a path, and errors of postures."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from paretoik.verification.arm_model import ArmModel, rotation_of
from paretoik.verification.tolerances import OPTIONS

Targets: TypeAlias = list[tuple[Any, np.ndarray, np.ndarray | None]]  # tasks with positions and rotations (time, ...)
TURNING_AXES = {"xyz+z-axis": (0, 1), "xy+angle": (2,), "pose": (0, 1, 2)}  # equations of orientation, in the frame


def covered(law: str, fraction: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the fraction of a path covered at fractions of the duration, and two derivatives.

    The raised cosine is integrated from its acceleration a(τ) = ±4 (1 − cos 4πτ), + in the first half.
    """
    if law == "uniform":
        return fraction, np.ones_like(fraction), np.zeros_like(fraction)
    if law == "quintic":
        law_of_time = np.poly1d([6.0, -15.0, 10.0, 0.0, 0.0, 0.0])
        return law_of_time(fraction), law_of_time.deriv()(fraction), law_of_time.deriv(2)(fraction)
    early = fraction <= 0.5
    half = np.where(early, fraction, 1.0 - fraction)
    bend = 4.0 * (1.0 - np.cos(4.0 * np.pi * half))
    risen = 2.0 * half**2 - (1.0 - np.cos(4.0 * np.pi * half)) / (4.0 * np.pi**2)
    speed = 4.0 * half - np.sin(4.0 * np.pi * half) / np.pi
    return np.where(early, risen, 1.0 - risen), speed, np.where(early, bend, -bend)


def _shape(path: Any, t: np.ndarray) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray]:
    """Return a path's curve without timing, its parameter at times [s], and two derivatives of it."""
    curve, t = path.curve, np.asarray(t, dtype=float)
    if type(curve).__name__ != "TimedCurve":
        return curve, t, np.ones_like(t), np.zeros_like(t)
    parameter, speed, bend = covered(curve.law, t / curve.duration)
    return curve.shape, parameter, speed / curve.duration, bend / curve.duration**2


def path_points(path: Any, t: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Return positions (time, 2 or 3) [m] and rotations (time, 3, 3), or None, of a path at times [s].

    Lines and circles are computed from their numbers; splines are SciPy's own, other curves the user's function.
    """
    curve, parameter, _, _ = _shape(path, t)
    kind, share = type(curve).__name__, parameter[:, None]
    if kind == "Line":
        positions = np.asarray(curve.origin) + share * np.asarray(curve.step)
        if curve.quaternion is None:
            return positions, None
        start = Rotation.from_quat(np.roll(curve.quaternion, -1))
        return positions, (start * Rotation.from_rotvec(share * np.asarray(curve.rotation_vector))).as_matrix()
    if kind == "Circle":
        angle = curve.phase + curve.sweep * share
        positions = np.asarray(curve.center) + np.cos(angle) * curve.axes[0] + np.sin(angle) * curve.axes[1]
        quaternions = None if curve.quaternion is None else np.tile(curve.quaternion, (len(parameter), 1))
        return positions, _matrices(quaternions)
    if kind == "Spline":
        positions = np.asarray(curve.positions(parameter))
        return positions, None if curve.rotations is None else curve.rotations(parameter).as_matrix()
    positions, quaternions = curve(parameter)
    return positions, _matrices(quaternions)


def path_rates(path: Any, t: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return linear velocities and accelerations at times, then angular ones about world axes."""
    curve, parameter, *factors = _shape(path, t)
    speed, bend = (factor[:, None] for factor in factors)
    kind, none = type(curve).__name__, np.zeros((len(t), 3))
    if kind == "Line":
        axis = none
        if curve.quaternion is not None:
            axis = none + Rotation.from_quat(np.roll(curve.quaternion, -1)).apply(np.asarray(curve.rotation_vector))
        parts = np.tile(curve.step, (len(t), 1)), np.zeros((len(t), len(curve.step))), axis, none
    elif kind == "Circle":
        angle = (curve.phase + curve.sweep * parameter)[:, None]
        out = np.cos(angle) * curve.axes[0] + np.sin(angle) * curve.axes[1]
        along = np.cos(angle) * curve.axes[1] - np.sin(angle) * curve.axes[0]
        parts = curve.sweep * along, -(curve.sweep**2) * out, none, none
    elif kind == "Spline":
        turns = (none, none)
        if curve.rotations is not None:
            here = curve.rotations(parameter)
            turns = here.apply(curve.rotations(parameter, 1)), here.apply(curve.rotations(parameter, 2))
        parts = curve.positions(parameter, 1), curve.positions(parameter, 2), *turns
    else:
        rates = path.rates(t)  # a user's function has only differences
        return tuple(none if part is None else part for part in rates)
    return (
        parts[0] * speed,
        parts[0] * bend + parts[1] * speed**2,
        parts[2] * speed,
        parts[2] * bend + parts[3] * speed**2,
    )


def curve_states(
    model: ArmModel, tasks: Any, spline: tuple[np.ndarray, np.ndarray, np.ndarray], t: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return q, q̇ and q̈ (time, dof) of a spline's projection along its own normal directions.

    Derivatives of these directions are differences of the fourth order. If the spline is too far from the path, its own
    state is returned.
    """
    targets, rates = path_targets(tasks, t), [path_rates(task.path, t) for task in tasks]
    states = np.array(spline)
    for k in range(len(t)):
        s, ds, dds = (part[k] for part in spline)
        step = OPTIONS.turn / max(np.abs(ds).max(), np.sqrt(np.abs(dds).max()), 1e-12)
        around = [
            model.scales[:, None] ** 2 * task_errors(model, targets, s + x * ds + x * x / 2 * dds, k)[1].T
            for x in step * np.arange(-2.0, 3.0)
        ]
        directions = around[2]
        turn = np.tensordot([1.0, -8.0, 0.0, 8.0, -1.0], around, 1) / (12 * step)
        bend = np.tensordot([-1.0, 16.0, -30.0, 16.0, -1.0], around, 1) / (12 * step**2)
        q, size = s.copy(), np.inf
        for _ in range(12):
            miss, jacobian = task_errors(model, targets, q, k)
            size = np.abs(miss).max()
            if size <= 1e-13:
                break
            q = q + directions @ np.linalg.solve(jacobian @ directions, miss)
        if size > 1e-10:
            continue
        _, jacobian = task_errors(model, targets, q, k)
        matrix = jacobian @ directions
        moved = np.linalg.lstsq(directions, q - s, rcond=None)[0]
        dq = ds + turn @ moved
        rate = np.linalg.solve(matrix, _task_rates(model, tasks, rates, q, None, k) - jacobian @ dq)
        dq = dq + directions @ rate
        ddq = dds + bend @ moved + 2 * turn @ rate
        ddq = ddq + directions @ np.linalg.solve(matrix, _task_rates(model, tasks, rates, q, dq, k) - jacobian @ ddq)
        states[:, k] = q, dq, ddq
    return states[0], states[1], states[2]


def _task_rates(
    model: ArmModel, tasks: Any, rates: list[tuple[np.ndarray, ...]], q: np.ndarray, dq: np.ndarray | None, k: int
) -> np.ndarray:
    """Return the tasks' Jacobian times velocities, or times accelerations if velocities ``dq`` are given."""
    rows = []
    for task, parts in zip(tasks, rates, strict=True):
        v, a, turn, bend = (part[k] for part in parts)
        size, turning = task_axes(task, model.arm)
        rotation, _, jacobian = model.jacobian(q, task.frame)
        if dq is None:
            linear, angular = v[:size], turn
        else:
            drift, omega = model.drift(q, dq, task.frame), jacobian[3:] @ dq
            linear, angular = a[:size] - drift[:size], bend + np.cross(omega, omega - turn) - drift[3:]
        rows += [linear / model.length, (rotation.T @ angular)[list(turning)]]
    return np.concatenate(rows)


def path_targets(tasks: Any, t: np.ndarray) -> Targets:
    """Return the tasks with the positions and rotations of their paths at times [s]."""
    return [(task, *path_points(task.path, t)) for task in tasks]


def sample_points(path: Any) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the positions and rotations that a path lists for its samples."""
    return np.asarray(path.positions), _matrices(path.quaternions)


def task_axes(task: Any, arm: Any) -> tuple[int, tuple[int, ...]]:
    """Return a task's number of position coordinates, and its axes of orientation in the frame."""
    return 2 if task.axes in ("xy", "xy+angle") else 3, TURNING_AXES.get(task.axes, ())


def task_errors(model: ArmModel, targets: Targets, q: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return errors [shares of the arm's length, rad] and Jacobian of all tasks in a posture, target k."""
    errors, rows = list[np.ndarray](), list[np.ndarray]()
    for task, positions, rotations in targets:
        size, turning = task_axes(task, model.arm)
        here, place, jacobian = model.jacobian(q, task.frame)
        errors.append((positions[k, :size] - place[:size]) / model.length)
        rows.append(jacobian[:size] / model.length)
        if turning:
            assert rotations is not None
            vector = orientation_errors(task.axes, here[None], rotations[k : k + 1])[0]
            errors.append(vector[list(turning)])
            rows.append((here.T @ jacobian[3:])[list(turning)])
    return np.concatenate(errors), np.concatenate(rows)


def orientation_errors(axes: str, here: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return rotation vectors (time, 3) [rad] to the target, in the frame; z-axis tasks ignore turns about z."""
    between = here.swapaxes(-1, -2) @ target
    if axes != "xyz+z-axis":
        return np.asarray(Rotation.from_matrix(between).as_rotvec())
    z = between[..., 2]
    across = np.stack([-z[..., 1], z[..., 0], np.zeros_like(z[..., 0])], axis=-1)
    sine = np.linalg.norm(across, axis=-1)
    angle = np.arctan2(sine, z[..., 2])
    return across * np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1.0), 1.0)[..., None]


def frame_errors(
    model: ArmModel, task: Any, q: np.ndarray, targets: tuple[np.ndarray, np.ndarray | None] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return a frame's errors of position (time, 2 or 3) [m] and of orientation (time, 0 to 3) [rad].

    targets: positions and rotations; default: those that the path lists for its samples
    """
    positions, rotations = sample_points(task.path) if targets is None else targets
    size, turning = task_axes(task, model.arm)
    here, place = model.poses(q, task.frame)
    vectors = np.zeros((len(q), 0))
    if turning and rotations is not None:
        vectors = orientation_errors(task.axes, here, rotations)[:, list(turning)]
    return positions[:, :size] - place[:, :size], vectors


def tracking_errors(model: ArmModel, task: Any, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a frame's distances [m] and angles [rad] (time,) from its target at every sample."""
    offsets, vectors = frame_errors(model, task, q)
    return np.linalg.norm(offsets, axis=1), np.linalg.norm(vectors, axis=1)


def _matrices(quaternions: np.ndarray | None) -> np.ndarray | None:
    return None if quaternions is None else rotation_of(quaternions)

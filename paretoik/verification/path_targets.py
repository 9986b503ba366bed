"""Where the tool must be, worked out anew from the numbers of a path, and how far a posture is off."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from paretoik.verification.arm_model import ArmModel

TURNING_AXES = {"xyz+z-axis": (0, 1), "xy+angle": (2,), "pose": (0, 1, 2)}  # equations of orientation, in the frame


def covered(law: str, fraction: np.ndarray) -> np.ndarray:
    """Return how much of a path is covered at fractions of its duration, by the name of its time law.

    The raised cosine is integrated from its acceleration a(τ) = ±4 (1 − cos 4πτ), + in the first half.
    """
    if law == "uniform":
        return fraction
    if law == "quintic":
        return np.asarray(np.polyval([6.0, -15.0, 10.0, 0.0, 0.0, 0.0], fraction))
    half = np.where(fraction <= 0.5, fraction, 1.0 - fraction)
    risen = 2.0 * half**2 - (1.0 - np.cos(4.0 * np.pi * half)) / (4.0 * np.pi**2)
    return np.where(fraction <= 0.5, risen, 1.0 - risen)


def path_points(path: Any, t: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Return positions (time, 2 or 3) [m] and rotations (time, 3, 3), or None, of a path at times [s].

    Lines and circles are worked out from their numbers; splines are SciPy's own, other curves the user's function.
    """
    curve, parameter = path.curve, np.asarray(t, dtype=float)
    if type(curve).__name__ == "TimedCurve":
        parameter = covered(curve.law, parameter / curve.duration)
        curve = curve.shape
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


def sample_points(path: Any) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the positions and rotations of a path at its samples, as it lists them."""
    return np.asarray(path.positions), _matrices(path.quaternions)


def task_axes(task: Any, arm: Any) -> tuple[int, tuple[int, ...]]:
    """Return how many coordinates of position a task asks for, and which of orientation, in the frame."""
    return 2 if task.axes in ("xy", "xy+angle") else 3, TURNING_AXES.get(task.axes, ())


def task_error(
    model: ArmModel, task: Any, q: np.ndarray, position: np.ndarray, rotation: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return a task's errors (rows,) [share of the arm's length, rad] in one posture, and their Jacobian by joints."""
    size, turning = task_axes(task, model.arm)
    here, place, jacobian = model.jacobian(q, task.frame)
    error, rows = (position[:size] - place[:size]) / model.length, jacobian[:size] / model.length
    if turning:
        assert rotation is not None
        vector = orientation_errors(task.axes, here[None], rotation[None])[0]
        error = np.concatenate([error, vector[list(turning)]])
        rows = np.concatenate([rows, (here.T @ jacobian[3:])[list(turning)]])
    return error, rows


def orientation_errors(axes: str, here: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return the rotation vectors (time, 3) [rad], in the frame, that turn it as wanted; or its z axis alone."""
    between = here.swapaxes(-1, -2) @ target
    if axes != "xyz+z-axis":
        return np.asarray(Rotation.from_matrix(between).as_rotvec())
    z = between[..., 2]
    across = np.stack([-z[..., 1], z[..., 0], np.zeros_like(z[..., 0])], axis=-1)
    sine = np.linalg.norm(across, axis=-1)
    angle = np.arctan2(sine, z[..., 2])
    return across * np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1.0), 1.0)[..., None]


def tracking_errors(
    model: ArmModel, task: Any, q: np.ndarray, positions: np.ndarray, rotations: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return how far a task's frame is off at every sample: distances [m] and angles [rad] (time,)."""
    size, turning = task_axes(task, model.arm)
    here, place = model.poses(q, task.frame)
    distance = np.linalg.norm(positions[:, :size] - place[:, :size], axis=1)
    if not turning or rotations is None:
        return distance, np.zeros(len(q))
    vectors = orientation_errors(task.axes, here, rotations)[:, list(turning)]
    return distance, np.linalg.norm(vectors, axis=1)


def _matrices(quaternions: np.ndarray | None) -> np.ndarray | None:
    if quaternions is None:
        return None
    return np.asarray(Rotation.from_quat(np.roll(quaternions, -1, axis=1)).as_matrix())

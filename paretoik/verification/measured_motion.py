"""A motion measured a second time: what an objective sees, from joint positions, Pinocchio and the curve rebuilt."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from paretoik.verification.arm_model import ArmModel
from paretoik.verification.interpolant import instants_of, quadrature, rates, rebuild
from paretoik.verification.obstacle_distances import pair_distances
from paretoik.verification.path_targets import curve_states, path_points, task_axes, task_error, tracking_errors


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredMotion:
    """One motion (1, time, dof) at the instants at which its problem holds limits and objectives.

    It has what user functions read of a ``Motion``, batch first. ``task`` is the problem's: its arm, tasks, obstacles.
    """

    model: ArmModel
    task: Any
    time: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    jerk: np.ndarray
    weights: np.ndarray
    link_radius: float = 0.0
    coefficients: np.ndarray | None = None
    of_spline: MeasuredMotion | None = None

    @property
    def spline(self) -> MeasuredMotion:
        """The motion of the spline that is not projected: of this integrals with kinks are minimised."""
        return self if self.of_spline is None else self.of_spline

    @property
    def velocity_bounds(self) -> np.ndarray:
        """Velocities, at the middles of intervals Bernstein coefficients of a spline's."""
        return self.dq if self.coefficients is None else self.coefficients

    @property
    def arm(self) -> Any:
        """The arm that moves."""
        return self.model.arm

    @property
    def tasks(self) -> Any:
        """The tasks of the motion."""
        return getattr(self.task, "tasks", ())

    @property
    def obstacles(self) -> Any:
        """The obstacles of the problem."""
        return getattr(self.task, "obstacles", ())

    @property
    def instants(self) -> MeasuredMotion:
        """The motion itself."""
        return self

    @property
    def duration(self) -> np.ndarray:
        """Time (1,) from the first to the last instant [s]."""
        return np.asarray(self.time[:, -1] - self.time[:, 0])

    def __len__(self) -> int:
        return len(self.q)

    def __iter__(self) -> Iterator[Any]:
        return iter((self,))

    @cached_property
    def torque(self) -> np.ndarray:
        """Joint torques [N m, N]."""
        return self.model.torques(self.q[0], self.dq[0], self.ddq[0])[None]

    @cached_property
    def power(self) -> np.ndarray:
        """Joint powers [W]."""
        return self.torque * self.dq

    @cached_property
    def kinetic_energy(self) -> np.ndarray:
        """Kinetic energies (1, time) [J]."""
        return self.model.kinetic_energies(self.q[0], self.dq[0])[None]

    @cached_property
    def tool(self) -> np.ndarray:
        """Positions of the tool (1, time, 2 or 3) [m]."""
        position = self.model.poses(self.q[0])[1]
        return position[None, :, : 2 if self.arm.is_planar else 3]

    @cached_property
    def tool_rotation(self) -> np.ndarray:
        """Orientations of the tool (1, time, 3, 3)."""
        return self.model.poses(self.q[0])[0][None]

    @cached_property
    def links(self) -> np.ndarray:
        """The arm as a polyline (1, time, dof + 2, 3) [m]."""
        return self.model.nodes(self.q[0])[None]

    @cached_property
    def clearance(self) -> np.ndarray:
        """Distances of links from obstacles (1, time) [m]."""
        return self.pair_clearances.min(axis=(1, 2))[None]

    @cached_property
    def pair_clearances(self) -> np.ndarray:
        """Distances of every link from every obstacle (time, links, obstacles) [m]."""
        return pair_distances(self.obstacles, self.links[0]) - self.link_radius

    @cached_property
    def manipulability(self) -> np.ndarray:
        """Yoshikawa's measure of the tasks' Jacobian (1, time), by its singular values."""
        if not self.tasks:
            size = slice(0, 2) if self.arm.is_planar else slice(0, 6)
            jacobians = [self.model.jacobian(q)[2][size] for q in self.q[0]]
        else:
            jacobians = [np.concatenate([self._task_jacobian(task, q) for task in self.tasks]) for q in self.q[0]]
        return np.array([np.prod(np.linalg.svd(each, compute_uv=False)) for each in jacobians])[None]

    @cached_property
    def position_error(self) -> np.ndarray:
        """Largest distance of a task's frame from its target (1, time) [m]."""
        return self._misses[0]

    @cached_property
    def tracking_error(self) -> np.ndarray:
        """Largest entry of the tasks' errors (1, time) [m or rad]."""
        return self._misses[1]

    def integral(self, series: np.ndarray) -> np.ndarray:
        """Return the time integral (1,) of values at the instants (1, time)."""
        return np.asarray(series @ self.weights)

    @cached_property
    def _misses(self) -> tuple[np.ndarray, np.ndarray]:
        distance, largest = np.zeros(self.time.shape), np.zeros(self.time.shape)
        for task in self.tasks:
            size, _ = task_axes(task, self.arm)
            positions, rotations = path_points(task.path, self.time[0])
            distances, angles = tracking_errors(self.model, task, self.q[0], positions, rotations)
            place = self.model.poses(self.q[0], task.frame)[1]
            entries = np.abs(positions[:, :size] - place[:, :size]).max(axis=1)
            distance[0] = np.maximum(distance[0], distances)
            largest[0] = np.maximum(largest[0], np.maximum(entries, angles))
        return distance, largest

    def _task_jacobian(self, task: Any, q: np.ndarray) -> np.ndarray:
        positions, rotations = path_points(task.path, np.zeros(1))
        rows = task_error(self.model, task, q, positions[0], None if rotations is None else rotations[0])[1]
        return rows * np.where(np.arange(len(rows)) < task_axes(task, self.arm)[0], self.model.length, 1.0)[:, None]


def measure(model: ArmModel, task: Any, time: np.ndarray, q: np.ndarray) -> MeasuredMotion:
    """Return joint positions (time, dof) at times as a motion of a task, at its instants."""
    differences, cyclic = str(getattr(task, "differences", "backward")), bool(getattr(task, "cyclic", False))
    rest = bool(getattr(task, "ends_at_rest", False))
    curve = rebuild(time, q, differences=differences, cyclic=cyclic, ends_at_rest=rest)
    dq, ddq, jerk = rates(curve, time, q, differences=differences, cyclic=cyclic)
    t = instants_of(time, differences)
    bounds, spline = None, None
    weights, radius = quadrature(time, differences), float(getattr(task, "link_radius", 0.0))

    def measured(state: tuple[np.ndarray, ...], **settings: Any) -> MeasuredMotion:
        rows: dict[str, Any] = dict(
            zip(("q", "dq", "ddq", "jerk"), (np.asarray(part)[None] for part in state), strict=True)
        )
        return MeasuredMotion(
            model=model, task=task, time=t[None], weights=weights, link_radius=radius, **rows, **settings
        )

    if differences == "spline":
        state = np.array(curve(t)), dq, ddq
        spline = measured((*state, jerk))
        q, dq, ddq = curve_states(model, task.tasks, state, t) if getattr(task, "tasks", ()) else state
        bounds = np.array(dq)[None]  # a parabola's coefficient is v + h a / 2 of the sample before
        bounds[0, 1::2] += dq[:-1:2] + np.diff(time)[:, None] / 2 * ddq[:-1:2] - dq[1::2]
    return measured((q, dq, ddq, jerk), coefficients=bounds, of_spline=spline)

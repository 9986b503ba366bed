"""A motion: joint positions at sample times, and all quantities that follow from them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import get_args

import numpy as np
from jaxtyping import Float

from paretoik.arrays import JointPaths, Rotations, Series, read_only
from paretoik.collision.obstacles import LinkRadius, Obstacle, check_names, clearance
from paretoik.errors import Infeasible, InvalidInput
from paretoik.inputs import (
    check_choice,
    check_flag,
    check_instance,
    finite_array,
    read_list,
    real_array,
)
from paretoik.robot import dynamics, kinematics
from paretoik.robot.arm import Arm, check_arm
from paretoik.robot.kinematics import joint_scales
from paretoik.tables import columns, fit_screen, html_representation
from paretoik.task.differences import (
    DIFFERENCES,
    Derivatives,
    Differences,
    Spline,
    evaluate_with_midpoints,
    first_derivative,
    fit_spline,
    quadrature_weights,
    second_derivative,
    simpson_weights,
    with_midpoints,
)
from paretoik.task.joint_curve import JointState, interpolate, project_rates, target_rates
from paretoik.task.path_shapes import CLOSURE_TOLERANCE
from paretoik.task.retraction import ON_PATH_TOLERANCE, retract_nearest, task_errors
from paretoik.task.task import Task, path_targets

# Checks of a motion's parts.


def checked_samples(arm: Arm, q: object, time: object) -> tuple[JointPaths, np.ndarray]:
    """Return the samples of a motion and their times as floats. Raises InvalidInput."""
    check_arm("motion: arm", arm)
    positions, times = real_array("motion: q", q), real_array("motion: time", time)
    if positions.ndim < 2 or positions.shape[-1] != arm.dof:
        raise InvalidInput(f"motion of {arm.name}: q must have shape (..., time, {arm.dof}), got {positions.shape}")
    if positions.shape[-2] < 3 or times.shape not in (positions.shape[-2:-1], positions.shape[:-1]):
        fact = f"got shape {times.shape} for q of shape {positions.shape}"
        raise InvalidInput(f"motion: time must have one value per sample, at least 3, {fact}")
    for name, values in (("position", positions), ("time", times[..., None])):
        invalid = np.argwhere(~np.isfinite(values))
        if len(invalid):
            got = values[tuple(invalid[0])]
            raise InvalidInput(f"motion: every {name} must be finite, got {got} at sample {invalid[0][-2]}")
    decreasing = np.argwhere(np.diff(times) <= 0)
    if len(decreasing):
        k = decreasing[0][-1] + 1
        raise InvalidInput(f"motion: times must increase, got one that does not at sample {k}")
    return positions, times


def check_obstacles(obstacles: object) -> None:
    """Raise InvalidInput unless the argument is a list of obstacles with different names."""
    check_names(read_list("obstacles", obstacles, Obstacle, "a list of obstacles"))


def checked_link_radius(radius: object, arm: Arm) -> LinkRadius:
    """Return one radius of all links, or a tuple of one per link; raises InvalidInput for others.

    Links are the segments between consecutive ``Motion.links``: the base, then one per joint.
    """
    numbers, links = finite_array("link_radius", radius), arm.dof + 1
    if numbers.shape not in ((), (links,)):
        many = f"{numbers.size} number{'s' * (numbers.size != 1)}" if numbers.ndim == 1 else f"shape {numbers.shape}"
        raise InvalidInput(f"link_radius must be one number or one per link ({links}), got {many}")
    if numbers.min() < 0:
        where = f" for link {int(numbers.argmin())}" if numbers.ndim else ""
        raise InvalidInput(f"link_radius must be 0 m or more, got {numbers.min():g}{where}")
    return tuple(numbers.tolist()) if numbers.ndim else float(numbers)


# The motion and its quantities.


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """One joint motion of an arm, or a batch of them.

    arm: arm that moves
    time: sample times (*batch, time) [s]
    q: joint positions (*batch, time, dof) [rad, m] at the samples
    tasks: tasks that the motion follows
    obstacles: obstacles for ``clearance``
    link_radius: radius of all links [m], or one per link: of the base, then of the link after each joint
    differences: kind of velocities and accelerations at the samples, see below
    cyclic: whether the motion ends as it starts: q_N = q₀, v₀ = v_N
    ends_at_rest: whether a spline ends with velocity 0
    derivatives: given velocities and accelerations; None to derive them from the samples

    A motion is a C² curve, a cubic spline that is projected onto its tasks (``at``, ``state``). Differences are

    - "spline": velocities and accelerations are those of the curve, as in ``state``. The spline passes within about
      δ⁴q/36 of the inner samples. Objectives and limits are evaluated at ``instants``, the samples and the midpoints
      between them, integrals by Simpson's rule; integrals with kinks use ``of_spline``.
    - "backward" as in Tringali & Cocuzza 2020 (v₀ = a₀ = 0, vᵢ = (qᵢ − qᵢ₋₁)/Δt, aᵢ = (vᵢ − vᵢ₋₁)/Δt, integrals by the
      right rectangle rule), or "central" (second order, integrals by the trapezoid rule). These are differences of the
      samples, as in papers: ``dq`` and ``ddq`` differ from ``state`` by their discretisation error. The spline passes
      through the samples.

    ``motion[i]`` selects from the batch; arrays are read-only. Raises InvalidInput if shapes do not fit the arm, a
    number is not finite, times do not increase, or a cyclic motion does not close.
    """

    arm: Arm
    time: Float[np.ndarray, "*#batch time"]
    q: JointPaths
    tasks: tuple[Task, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    link_radius: LinkRadius = 0.0
    differences: Differences = DIFFERENCES
    cyclic: bool = False
    ends_at_rest: bool = False
    derivatives: Derivatives | None = None

    def __post_init__(self) -> None:
        q, time = checked_samples(self.arm, self.q, self.time)
        check_choice("differences", self.differences, get_args(Differences))
        check_flag("cyclic", self.cyclic)
        check_flag("ends_at_rest", self.ends_at_rest)
        read_list("tasks", self.tasks, Task, "a tuple of tasks")
        check_obstacles(self.obstacles)
        object.__setattr__(self, "link_radius", checked_link_radius(self.link_radius, self.arm))
        check_instance("derivatives", self.derivatives, Derivatives | None, "Derivatives or None")
        if self.cyclic:
            distance = np.abs(q[..., -1, :] - q[..., 0, :])
            if (distance / joint_scales(self.arm)).max(initial=0.0) > CLOSURE_TOLERANCE:
                raise InvalidInput(
                    f"cyclic motion: must end where it starts, got end points {distance.max():.3g} rad or m apart"
                )
            q[..., -1, :] = q[..., 0, :]
        object.__setattr__(self, "q", read_only(q))
        object.__setattr__(self, "time", np.broadcast_to(read_only(time), q.shape[:-1]))

    def __len__(self) -> int:
        """Return the size of the leading batch axis; a single motion has none."""
        if self.q.ndim == 2:
            raise TypeError("a single motion has no length")
        return len(self.q)

    def __repr__(self) -> str:
        return fit_screen(motion_text(self))

    _repr_html_ = html_representation

    def __getitem__(self, index: int | slice | np.ndarray) -> Motion:
        if self.q.ndim == 2:
            raise TypeError("a single motion cannot be indexed")
        derivatives = None if self.derivatives is None else self.derivatives[index]
        return replace(self, q=self.q[index], time=self.time[index], derivatives=derivatives)

    def __iter__(self) -> Iterator[Motion]:
        return (self[i] for i in range(len(self)))

    @property
    def duration(self) -> Float[np.ndarray, "*#batch"]:
        """Time (*batch,) from the first to the last sample [s]."""
        return np.asarray(self.time[..., -1] - self.time[..., 0])

    @cached_property
    def dq(self) -> JointPaths:
        """Joint velocities (*batch, time, dof) [rad/s, m/s]."""
        if self.derivatives is not None:
            return self.derivatives.dq
        if self.differences == "spline":
            return read_only(self._nodes.dq[..., ::2, :])
        return read_only(first_derivative(self.q, self.time, self.differences, cyclic=self.cyclic))

    @cached_property
    def ddq(self) -> JointPaths:
        """Joint accelerations (*batch, time, dof) [rad/s², m/s²]."""
        if self.derivatives is not None:
            return self.derivatives.ddq
        if self.differences == "spline":
            return read_only(self._nodes.ddq[..., ::2, :])
        return read_only(second_derivative(self.q, self.time, self.differences, cyclic=self.cyclic))

    @cached_property
    def jerk(self) -> JointPaths:
        """Joint jerks (*batch, time, dof) [rad/s³, m/s³], by differences or of the spline."""
        if self.derivatives is not None:
            return self.derivatives.jerk
        if self.differences == "spline":
            return read_only(evaluate_with_midpoints(self.spline)[2].jerk[..., ::2, :])
        return read_only(first_derivative(self.ddq, self.time, self.differences, cyclic=self.cyclic))

    @cached_property
    def torque(self) -> JointPaths:
        """Joint torques (*batch, time, dof) [N m, N], gravity included."""
        return read_only(dynamics.inverse_dynamics(self.arm, self.q, self.dq, self.ddq))

    @cached_property
    def power(self) -> JointPaths:
        """Mechanical joint powers τᵢ q̇ᵢ (*batch, time, dof) [W]."""
        return read_only(self.torque * self.dq)

    @cached_property
    def kinetic_energy(self) -> Series:
        """Kinetic energy ½ q̇ᵀ M q̇ (*batch, time) [J]."""
        return read_only(dynamics.kinetic_energy(self.arm, self.q, self.dq))

    @cached_property
    def tool(self) -> Float[np.ndarray, "*batch time axes"]:
        """Position of the tool (*batch, time, 2) for planar arms, (*batch, time, 3) for others [m]."""
        position = self._tool_pose[1]
        return position[..., :2] if self.arm.is_planar else position

    @cached_property
    def tool_rotation(self) -> Rotations:
        """Orientation of the tool (*batch, time, 3, 3)."""
        return self._tool_pose[0]

    @cached_property
    def links(self) -> Float[np.ndarray, "*batch time nodes 3"]:
        """The arm as a polyline (*batch, time, dof + 2, 3) [m]: base, joints, tool."""
        return read_only(kinematics.link_nodes(self.arm, self.q))

    @cached_property
    def manipulability(self) -> Series:
        """Yoshikawa's √det(J Jᵀ) (*batch, time) of the tasks, or of the tool if there are no tasks."""
        if self.tasks:
            jacobian = self._errors[1]
        else:
            jacobian = kinematics.jacobian(self.arm, self.q)[..., : 2 if self.arm.is_planar else 6, :]
        return read_only(np.sqrt(np.maximum(np.linalg.det(jacobian @ np.swapaxes(jacobian, -1, -2)), 0.0)))

    @cached_property
    def tracking_error(self) -> Series:
        """Largest task error of each sample (*batch, time) [m or rad]; 0 without tasks."""
        if not self.tasks:
            return np.zeros(self.q.shape[:-1])
        return read_only(np.abs(self._errors[0]).max(axis=-1))

    @cached_property
    def position_error(self) -> Series:
        """Largest distance of a task's frame from its target (*batch, time) [m]; zero without tasks."""
        if not self.tasks:
            return np.zeros(self.q.shape[:-1])
        error, _ = self._errors
        first_rows = np.cumsum([0, *(task.rows for task in self.tasks)])
        parts = [error[..., row : row + task.position_rows] for task, row in zip(self.tasks, first_rows, strict=False)]
        return read_only(np.max([np.linalg.norm(part, axis=-1) for part in parts], axis=0))

    @cached_property
    def clearance(self) -> Series:
        """Distance [m] of the links from the nearest obstacle (*batch, time). Links are capsules of ``link_radius``."""
        return read_only(clearance(self.obstacles, self.links, self.link_radius))

    @cached_property
    def spline(self) -> Spline:
        """The cubic spline near the samples, for ``differences`` "spline"."""
        return fit_spline(self.q, self.time, cyclic=self.cyclic, ends_at_rest=self.ends_at_rest)

    @cached_property
    def instants(self) -> Motion:
        """The motion at the times at which objectives and limits are evaluated.

        For splines these are the samples and midpoints, (*batch, 2 · time − 1, dof), with values of the curve, or of
        the spline if it cannot be retracted. Otherwise it is the motion itself.
        """
        if self.differences != "spline" or self.derivatives is not None:
            return self
        time, _, spline = evaluate_with_midpoints(self.spline)
        q, dq, ddq = self._nodes
        bounds = dq.copy()  # middle Bernstein coefficient of a parabola: v + h a / 2 of the previous sample
        bounds[..., 1::2, :] = dq[..., :-1:2, :] + np.diff(self.time)[..., None] / 2 * ddq[..., :-1:2, :]
        derivatives = replace(spline, dq=dq, ddq=ddq, velocity_bounds=bounds, spline=self._spline_nodes)
        return replace(self, time=time, q=q, derivatives=derivatives)

    @cached_property
    def of_spline(self) -> Motion:
        """The state of the spline at the ``instants`` before its projection, if there is one.

        Integrals with kinks use it: a joint at rest on the spline can move a little on the curve.
        """
        instants = self.instants
        if instants.derivatives is None or instants.derivatives.spline is None:
            return instants
        q, dq, ddq = instants.derivatives.spline
        derivatives = replace(instants.derivatives, dq=dq, ddq=ddq, velocity_bounds=dq.copy(), spline=None)
        return replace(instants, q=q, derivatives=derivatives)

    @property
    def velocity_bounds(self) -> JointPaths:
        """Velocities at the ``instants``; at midpoints of a spline, its middle Bernstein coefficients."""
        return self.dq if self.derivatives is None else self.derivatives.velocity_bounds

    @property
    def weights(self) -> Series:
        """Quadrature weights (*batch, time) [s] of integrals over the samples."""
        if self.differences == "spline" and self.derivatives is not None:
            return simpson_weights(self.time)
        return quadrature_weights(self.time, self.differences)

    def integral(self, series: Series) -> np.ndarray:
        """Return the time integral (*batch,) of values at the samples.

        Raises InvalidInput unless the values are (*batch, time).
        """
        values, weights = real_array("series", series), self.weights
        if values.shape[-1:] not in ((), (1,), weights.shape[-1:]):
            raise InvalidInput(f"series must have values at {weights.shape[-1]} samples, got shape {values.shape}")
        with np.errstate(invalid="ignore"):  # an infinite value times a weight of 0 is NaN
            return np.asarray(np.sum(values * weights, axis=-1))

    def at(
        self, t: Float[np.ndarray, " instants"], *, project: bool = True
    ) -> Float[np.ndarray, "*batch instants dof"]:
        """Return joint positions (*batch, instants, dof) of the curve.

        t: times (instants,) [s]
        project: False for the spline before its projection onto the tasks, within about δ⁴q/36 of the path

        Raises InvalidInput for times outside the motion, Infeasible if it cannot be projected there.
        """
        instants = self._instants(t, project)
        q = self._curve(instants)
        return self._project(q, instants) if self.tasks and project else q

    def state(self, t: Float[np.ndarray, " instants"], *, project: bool = True) -> JointState:
        """Return joint positions, velocities and accelerations, each (*batch, instants, dof).

        t: times (instants,) [s]
        project: as for ``at``

        In ``q, dq, ddq = motion.state(t)`` q is that of ``at``, with its exact derivatives: J q̇ is the velocity of the
        path. At samples they equal ``motion.dq`` and ``ddq`` if ``differences`` is "spline"; other differences have an
        error. Raises as ``at`` does.
        """
        instants = self._instants(t, project)
        spline = JointState(*(self._curve(instants, order) for order in range(3)))
        if not (self.tasks and project):
            return spline
        q = self._project(spline.q, instants)
        return project_rates(self.arm, self.tasks, spline, q, target_rates(self.tasks, instants))

    def _instants(self, t: np.ndarray, project: bool) -> np.ndarray:
        """Return times as an array. Raises InvalidInput for times outside the motion."""
        check_flag("project", project)
        instants = np.atleast_1d(finite_array("at: times t", t))
        if instants.ndim != 1:
            raise InvalidInput(f"at: times t must be one row of numbers, got shape {instants.shape}")
        first, last = self.time[..., 0].max(), self.time[..., -1].min()
        rounding = 1e-12 * (last - first)
        outside = instants[~((instants >= first - rounding) & (instants <= last + rounding))]
        if len(outside):
            raise InvalidInput(f"at: times t must be from {first:g} s to {last:g} s, got {outside[0]:g} s")
        return instants

    def _curve(self, instants: np.ndarray, order: int = 0) -> Float[np.ndarray, "*batch instants dof"]:
        """Return the spline of the motion, or its derivative of an order up to 2."""
        if self.differences == "spline" and self.derivatives is None:
            return self.spline.at(instants)[order]
        return interpolate(self.q, self.time, instants, cyclic=self.cyclic, order=order)

    @cached_property
    def _spline_nodes(self) -> JointState:
        """State of the spline at samples and midpoints."""
        _, q, rates = evaluate_with_midpoints(self.spline)
        return JointState(q, rates.dq, rates.ddq)

    @cached_property
    def _nodes(self) -> JointState:
        """State at samples and midpoints: on the path, or on the spline if it cannot be retracted."""
        spline = self._spline_nodes
        if not self.tasks:
            return spline
        times, inverse = np.unique(with_midpoints(self.time), return_inverse=True)
        targets = [part[inverse.reshape(spline.q.shape[:-1])] for part in target_rates(self.tasks, times)]
        retraction = retract_nearest(self.arm, self.tasks, spline.q, targets[0])
        on_path, state = retraction.on_path, JointState(*(part.copy() for part in spline))
        rows, places = JointState(*(part[on_path] for part in spline)), [part[on_path] for part in targets]
        projected = project_rates(self.arm, self.tasks, rows, retraction.q[on_path], places)
        for part, values in zip(state, projected, strict=True):
            part[on_path] = values
        if self.cyclic:
            for part in state:
                part[..., -1, :] = part[..., 0, :]
        return state

    def _project(self, q: np.ndarray, instants: np.ndarray) -> np.ndarray:
        retraction = retract_nearest(self.arm, self.tasks, q, path_targets(self.tasks, instants))
        if not retraction.on_path.all():
            off_path = np.unravel_index(int(np.argmin(retraction.on_path)), q.shape[:-1])
            where = f"at: the motion must follow its path, but at {instants[off_path[-1]]:g} s"
            error = retraction.error[off_path]
            if error <= ON_PATH_TOLERANCE:
                raise Infeasible(f"{where} it meets a singularity of its tasks")
            raise Infeasible(f"{where} its tool is off by {error:.3g} rad or arm lengths")
        return retraction.q

    @property
    def _errors(self) -> tuple[np.ndarray, np.ndarray]:
        times, inverse = np.unique(self.time, return_inverse=True)
        targets = path_targets(self.tasks, times)[inverse.reshape(self.time.shape)]
        return task_errors(self.arm, self.tasks, self.q, targets)

    @cached_property
    def _tool_pose(self) -> tuple[np.ndarray, np.ndarray]:
        rotation, position = kinematics.forward_kinematics(self.arm, self.q)
        return read_only(rotation), read_only(position)


def motion_text(motion: Motion) -> str:
    """Return the numbers of motions and samples, and the range of every joint."""
    batch, samples = motion.q.shape[:-2], motion.q.shape[-2]
    count = "one motion" if not batch else f"motions {' × '.join(map(str, batch))}"
    shortest, longest = np.min(motion.duration, initial=np.inf), np.max(motion.duration, initial=0.0)
    lasts = f"{longest:.4g} s" if shortest >= longest else f"{shortest:.4g} to {longest:.4g} s"
    lines = [f"Motion of {motion.arm.name}: {count}, {samples} samples, {lasts}"]
    if motion.q.size:
        rows = [["joint", "unit", "lowest position", "highest position", "highest speed per s"]]
        low, high, speed = (each.reshape(-1, motion.arm.dof) for each in (motion.q, motion.q, np.abs(motion.dq)))
        for i, (name, kind) in enumerate(zip(motion.arm.joint_names, motion.arm.joint_types, strict=True)):
            numbers = (low[:, i].min(), high[:, i].max(), speed[:, i].max())
            rows.append([name, "m" if kind == "prismatic" else "rad", *(f"{number:.4g}" for number in numbers)])
        lines.append(columns(rows))
    return "\n".join([*lines, "has .time .q .dq .ddq .torque .power .tool, .at(t) between samples"])

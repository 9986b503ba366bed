"""A task: a frame of the arm that must follow a path in some axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal, TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Times
from paretoik.autodiff.tape import where
from paretoik.errors import InvalidInput
from paretoik.inputs import check_choice, check_instance, check_text, shown
from paretoik.robot.arm import Arm
from paretoik.robot.arm_arguments import TOOL_FRAME
from paretoik.robot.components import (
    Component,
    Matrix,
    Vector,
    apply_transposed,
    dot,
    minus,
    multiply,
    plus,
    scale,
    times,
    transpose,
)
from paretoik.robot.kinematics import (
    LinkFrames,
    characteristic_length,
    frame_components,
    jacobian_components,
    joint_scales,
    link_frames,
)
from paretoik.robot.pose import Frame, quaternion_to_matrix, rotation_vector
from paretoik.tables import represented
from paretoik.task.path import Path

# Orientation errors of a frame relative to a desired rotation, in components (expressions or numbers)


SINE_TOLERANCE = 1e-12  # sine of a rotation's angle below which its axis is only rounding error


def axis_times_sine(axes: str, between: Matrix) -> Vector:
    """Return axis · sin(angle) of a rotation; for "xyz+z-axis", of the smallest rotation with the same z axis."""
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = between
    if axes == "xyz+z-axis":
        return zy, times(-1.0, zx), 0.0
    return scale((minus(zy, yz), minus(xz, zx), minus(yx, xy)), 0.5)


def orientation_error(axes: str, rotation: Matrix, desired: Matrix) -> Vector:
    """Return the rotation vector of RᵀR_d; for "xyz+z-axis", of the smallest rotation from z to z_d."""
    between = multiply(transpose(rotation), desired)
    if axes == "xyz+z-axis":
        x, y, z = transpose(between)[2]
        sine = np.sqrt(plus(times(x, x), times(y, y)))
        factor = _angle_over_sine(sine, z)
        return where(_is_half_turn(sine, z), np.pi, times(-1.0, times(y, factor))), times(x, factor), 0.0
    vector = axis_times_sine(axes, between)
    trace = plus(plus(between[0][0], between[1][1]), between[2][2])
    sine, cosine = np.sqrt(dot(vector, vector)), times(0.5, minus(trace, 1.0))
    opposite, error = _is_half_turn(sine, cosine), scale(vector, _angle_over_sine(sine, cosine))
    # Half turns: R + 1 = 2 a aᵀ, so that any nonzero column gives the axis a. The longest column has the largest
    # diagonal entry; the others may be 0.
    first, second, third = (tuple(plus(between[i][j], float(i == j)) for i in range(3)) for j in range(3))
    axis = _where(np.less_equal(third[2], second[1]), second, third)
    axis = _where(np.less_equal(third[2], first[0]) * np.less_equal(second[1], first[0]), first, axis)
    return _where(opposite, scale(axis, np.pi / np.sqrt(dot(axis, axis))), error)


def _angle_over_sine(sine: Component, cosine: Component) -> Any:
    small = np.less(sine, SINE_TOLERANCE)
    return where(small, 1.0, np.arctan2(sine, cosine) / where(small, 1.0, sine))


def _is_half_turn(sine: Component, cosine: Component) -> Any:
    return np.multiply(np.less(sine, SINE_TOLERANCE), np.less(cosine, 0.0))


def _where(condition: Component, first: Sequence[Component], second: Sequence[Component]) -> Vector:
    x, y, z = (where(condition, one, other) for one, other in zip(first, second, strict=True))
    return x, y, z


# The task: a frame that must follow a path.


Components: TypeAlias = Sequence[Component]
Axes = Literal["xy", "xy+angle", "xyz", "xyz+z-axis", "pose"]
AXES: dict[str | None, tuple[int, tuple[int, ...]]] = {  # number of coordinates, and entries of the rotation vector
    "xy": (2, ()),
    "xy+angle": (2, (2,)),
    "xyz": (3, ()),
    "xyz+z-axis": (3, (0, 1)),
    "pose": (3, (0, 1, 2)),
}


@represented
@dataclass(frozen=True, eq=False)
class Task:
    """A frame of the arm that follows a path.

    path: path of points or poses
    frame: name of a link of the URDF or of a joint, or "tool" if nothing else has this name
    axes: "xy" or "xyz" for position, "xy+angle" for position and angle in the x-y plane, "xyz+z-axis" for position and
        direction of the frame's z axis, "pose" for all six, None for all that the path gives (in a planar arm's plane)

    2-D points are for planar arms, and for arms in space whose frame keeps its height. Position errors are in m in
    world axes; orientation errors are the rotation vector [rad] of RᵀR_d. Raises InvalidInput for unknown axes, or axes
    that the path does not give.
    """

    path: Path
    frame: str = TOOL_FRAME
    axes: Axes | None = None

    def __post_init__(self) -> None:
        check_instance("path", self.path, Path, "a Path", example="pk.line(...)")
        check_text("frame", self.frame)
        if self.axes is None:
            return
        check_choice("axes", self.axes, AXES)
        if self.has_orientation and self.path.quaternions is None:
            hint = "pk.line(pk.Pose.from_rpy(xyz, rpy), ...) has poses"
            raise InvalidInput(f"path must have poses for axes {shown(self.axes)}, got points; {hint}")
        if self.axes == "xyz" and self.path.positions.shape[-1] == 2:
            raise InvalidInput("path must have 3-D points for axes 'xyz', got 2-D ones; axes='xy' leaves z free")

    def resolve_axes(self, arm: Arm) -> Task:
        """Return the task with axes; missing axes follow from arm and path.

        Given axes stay. 2-D points are "xy" also for an arm in space whose frame keeps its height, such as a gantry.
        Raises InvalidInput for axes that a planar arm does not have, 2-D points if the frame can rise, or a frame that
        is not on the arm.
        """
        arm.frame(self.frame)
        oriented = self.path.quaternions is not None
        flat = self.axes is None and not arm.is_planar and self.path.positions.shape[-1] == 2
        if flat:
            # the frame has one height at four postures; the tolerance allows for a URDF's rounded angles
            q = np.sin(np.arange(1.0, 4.0 * arm.dof + 1.0)).reshape(4, arm.dof) * joint_scales(arm)
            if np.ptp(arm.pose(q, frame=self.frame).position[:, 2]) <= 1e-4 * characteristic_length(arm):
                return replace(self, axes="xy")
            raise InvalidInput(
                f"path must have 3-D points, as {arm.name} moves in space, got 2-D ones; pk.Task(path, axes='xy') "
                "leaves z free"
            )
        if self.axes is None:
            planar: Axes = "xy+angle" if oriented else "xy"
            return replace(self, axes=planar if arm.is_planar else "pose" if oriented else "xyz")
        if arm.is_planar and self.axes not in ("xy", "xy+angle"):
            raise InvalidInput(f"{arm.name} moves in a plane: axes must be 'xy' or 'xy+angle', got {shown(self.axes)}")
        return self

    @property
    def position_rows(self) -> int:
        """Number of equations of position [m]; the others are of orientation [rad]."""
        return AXES[self.axes][0]

    @property
    def rotation_axes(self) -> tuple[int, ...]:
        """Indices of the rotation vector's entries that are equations."""
        return AXES[self.axes][1]

    @property
    def has_orientation(self) -> bool:
        """Whether some equations are of orientation."""
        return len(self.rotation_axes) > 0

    @property
    def rows(self) -> int:
        """Number of equations per sample."""
        return self.position_rows + len(self.rotation_axes)

    @property
    def target_size(self) -> int:
        """Number of columns of ``targets``."""
        return self.position_rows + 9 * self.has_orientation

    @property
    def displacement_size(self) -> int:
        """Number of columns of ``displacements``."""
        return self.position_rows + 3 * self.has_orientation

    def targets(self, t: Times) -> Float[np.ndarray, "time numbers"]:
        """Return positions at times t [s], then, if the task has orientation, rotation matrices row by row."""
        positions, quaternions = self.path.at(t)
        columns = [positions[:, : self.position_rows]]
        if quaternions is not None and self.has_orientation:
            columns.append(quaternion_to_matrix(quaternions).reshape(-1, 9))
        return np.concatenate(columns, axis=1)

    def target_rates(self, t: Times) -> tuple[Float[np.ndarray, "time numbers"], Float[np.ndarray, "time numbers"]]:
        """Return the first and second time derivatives of ``targets`` at times t [s]."""
        rates = self.path.rates(t)
        size = self.position_rows
        first, second = [rates.velocity[:, :size]], [rates.acceleration[:, :size]]
        if rates.angular_velocity is not None and rates.angular_acceleration is not None and self.has_orientation:
            rotation = self.targets(t)[:, size:].reshape(-1, 3, 3)
            turning = _cross_matrices(rates.angular_velocity)
            # Siciliano et al., Eq. 3.4: Ṙ = [ω] R, so that R̈ = ([ω̇] + [ω]²) R.
            first.append((turning @ rotation).reshape(-1, 9))
            bend = _cross_matrices(rates.angular_acceleration) + turning @ turning
            second.append((bend @ rotation).reshape(-1, 9))
        return np.concatenate(first, axis=1), np.concatenate(second, axis=1)

    def displacements(self, t: Times) -> Float[np.ndarray, "time displacements"]:
        """Return the displacement of the target from each time to the next.

        Times t are in s; the displacement from the last time is 0. A displacement has the position [m], then the
        rotation vector [rad] in world axes if the task has orientation. With "xyz+z-axis" the vector is the smallest
        one that rotates the z axis.
        """
        targets = self.targets(t)
        size = self.position_rows
        columns = [np.diff(targets[:, :size], axis=0, append=targets[-1:, :size])]
        if self.has_orientation:
            rotations = targets[:, size:].reshape(-1, 3, 3)
            later = np.concatenate([rotations[1:], rotations[-1:]])
            if self.axes == "xyz+z-axis":
                axis, cosine = np.cross(rotations[..., 2], later[..., 2]), (rotations[..., 2] * later[..., 2]).sum(-1)
                sine = np.linalg.norm(axis, axis=-1)
                angle_over_sine = np.arctan2(sine, cosine) / np.maximum(sine, SINE_TOLERANCE)
                columns.append(np.where(sine < SINE_TOLERANCE, 1.0, angle_over_sine)[:, None] * axis)
            else:
                columns.append(rotation_vector(later @ rotations.swapaxes(-1, -2)))
        return np.concatenate(columns, axis=1)

    def displacement_components(self, arm: Arm, links: LinkFrames, displacement: Components) -> list[Component]:
        """Return a row of ``displacements`` in the coordinates of ``errors``, as components."""
        components = list(displacement[: self.position_rows])
        if self.has_orientation:
            rotation, _ = frame_components(arm, links, frame_of(arm, self.frame))
            x, y, z = displacement[self.position_rows :]
            vector = apply_transposed(rotation, (x, y, z))
            components += [vector[i] for i in self.rotation_axes]
        return components

    def errors(self, arm: Arm, links: LinkFrames, target: Components) -> list[Component]:
        """Return the errors at a target as components."""
        rotation, position = frame_components(arm, links, frame_of(arm, self.frame))
        size = self.position_rows
        error = [minus(target[i], position[i]) for i in range(size)]
        if self.has_orientation:
            vector = orientation_error(self.axes or "", rotation, _matrix(target[size:]))
            error += [vector[i] for i in self.rotation_axes]
        return error

    def jacobian(self, arm: Arm, links: LinkFrames) -> list[list[Component]]:
        """Return the Jacobian rows of the frame as components. Newton's step solves J δq = error."""
        frame = frame_of(arm, self.frame)
        rotation, position = frame_components(arm, links, frame)
        columns = jacobian_components(arm, links, frame, position)
        jacobian = [[linear[i] for linear, _ in columns] for i in range(self.position_rows)]
        if self.has_orientation:
            in_frame = [apply_transposed(rotation, angular) for _, angular in columns]
            jacobian += [[angular[i] for angular in in_frame] for i in self.rotation_axes]
        return jacobian

    def equations(self, arm: Arm, links: LinkFrames, target: Components) -> list[Component]:
        """Return smooth functions that are 0 if the errors are 0.

        On the path, their gradients are the rows of the Jacobian. Sines of the angle replace the rotation vector: on
        the path they have derivatives of every order, and the same first and second derivatives. They are 0 at half
        turns too, so use them only for motions on the path.
        """
        rotation, position = frame_components(arm, links, frame_of(arm, self.frame))
        size = self.position_rows
        residuals = [minus(position[i], target[i]) for i in range(size)]
        if self.has_orientation:
            sines = axis_times_sine(self.axes or "", multiply(transpose(_matrix(target[size:])), rotation))
            residuals += [sines[i] for i in self.rotation_axes]
        return residuals


def error_unit(tasks: Sequence[Task]) -> str:
    """Return the unit of tasks' largest error: "m", or "m or rad" with orientation."""
    return " or ".join(dict.fromkeys(row_units(tasks)))


def row_units(tasks: Sequence[Task]) -> list[str]:
    """Return the unit of every row of task errors: m or rad."""
    return ["m" if row < task.position_rows else "rad" for task in tasks for row in range(task.rows)]


def describe_errors(tasks: Sequence[Task], errors: Float[np.ndarray, " rows"]) -> str:
    """Return in words the largest task errors at a sample, of position [m] and of orientation [rad]."""
    largest: dict[str, float] = {}
    for unit, error in zip(row_units(tasks), np.abs(errors), strict=True):
        largest[unit] = max(largest.get(unit, 0.0), float(error))
    return " and ".join(f"{error:.3g} {unit}" for unit, error in largest.items())


def path_targets(tasks: Sequence[Task], t: Times) -> Float[np.ndarray, "time numbers"]:
    """Return the ``targets`` of all tasks at times t [s], side by side."""
    return np.concatenate([task.targets(t) for task in tasks], axis=1)


def path_errors(arm: Arm, tasks: Sequence[Task], q: Components, targets: Components) -> list[Component]:
    """Return all tasks' errors at joint positions and targets, as components."""
    return _over_tasks(Task.errors, arm, tasks, q, targets)


def path_equations(arm: Arm, tasks: Sequence[Task], q: Components, targets: Components) -> list[Component]:
    """Return the ``equations`` of all tasks at joint positions and targets, as components."""
    return _over_tasks(Task.equations, arm, tasks, q, targets)


def path_jacobian(arm: Arm, tasks: Sequence[Task], q: Components) -> list[Component]:
    """Return the Jacobian of all tasks at joint positions, by rows, as components."""
    links = link_frames(arm, q)
    return [slope for task in tasks for row in task.jacobian(arm, links) for slope in row]


def _over_tasks(
    components: Callable[..., list[Component]], arm: Arm, tasks: Sequence[Task], q: Components, targets: Components
) -> list[Component]:
    links, values, first = link_frames(arm, q), list[Component](), 0
    for task in tasks:
        values += components(task, arm, links, targets[first : first + task.target_size])
        first += task.target_size
    return values


@lru_cache(maxsize=64)
def frame_of(arm: Arm, name: str) -> Frame:
    """Return a frame of an arm, from a cache."""
    return arm.frame(name)  # this search is slow, and retraction repeats it a thousand times


def _cross_matrices(vectors: Float[np.ndarray, "time 3"]) -> Float[np.ndarray, "time 3 3"]:
    """Return the matrices [a] with [a] b = a × b."""
    matrices = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    matrices[:, 2, 1], matrices[:, 0, 2], matrices[:, 1, 0] = x, y, z
    return matrices - matrices.swapaxes(-1, -2)


def _matrix(entries: Components) -> Matrix:
    return tuple(tuple(entries[3 * i : 3 * i + 3]) for i in range(3))  # type: ignore[return-value]

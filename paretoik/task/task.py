"""A task: a frame of the arm that must follow a path, and in which directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Times
from paretoik.autodiff.tape import where
from paretoik.errors import InvalidInput
from paretoik.robot.arm import Arm, Frame
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
from paretoik.robot.kinematics import LinkFrames, frame_components, jacobian_components
from paretoik.robot.pose import quaternion_to_matrix, rotation_vector
from paretoik.task.path import Path

Axes = Literal["xy", "xy+angle", "xyz", "xyz+z-axis", "pose"]
DUST = 1e-12  # sines this small have lost their direction
ROWS: dict[str, int] = {"xy": 2, "xy+angle": 3, "xyz": 3, "xyz+z-axis": 5, "pose": 6}


@dataclass(frozen=True, eq=False)
class Task:
    """Frame ``frame`` of the arm follows ``path`` in ``axes``.

    axes: "xy" and "xyz" ask for position, "xy+angle" for position and angle in the x-y plane, "xyz+z-axis" for position
    and direction of the frame's z axis, "pose" for all six. None takes what the path gives: its points, or its poses
    (in the plane for a planar arm). Position errors are in m in world axes; orientation errors are the rotation vector
    [rad] of RᵀR_d.

    Raises InvalidInput for unknown axes, or axes that the path says nothing about.
    """

    path: Path
    frame: str = "tool"
    axes: Axes | None = None

    def __post_init__(self) -> None:
        """Check the axes against the path."""
        if self.axes is None:
            return
        if self.axes not in ROWS:
            raise InvalidInput(f"axes must be one of {', '.join(ROWS)}, got {self.axes!r}")
        if self.axes in ("xy+angle", "xyz+z-axis", "pose") and self.path.quaternions is None:
            raise InvalidInput(f"axes {self.axes!r} wants a path of poses, got a path of points")
        if self.axes == "xyz" and self.path.positions.shape[-1] == 2:
            raise InvalidInput("axes 'xyz' wants a path of 3-D points, got a path of 2-D points")

    def settled(self, arm: Arm) -> Task:
        """Return the task with its axes decided for an arm.

        Raises InvalidInput where a planar arm is asked for what it cannot do, or the frame is not on the arm.
        """
        arm.frame(self.frame)
        points, turns = self.path.positions, self.path.quaternions is not None
        if self.axes is None:
            flat: Axes = "xy+angle" if turns else "xy"
            spatial: Axes = "pose" if turns else "xy" if points.shape[-1] == 2 else "xyz"
            return replace(self, axes=flat if arm.is_planar else spatial)
        if arm.is_planar and self.axes not in ("xy", "xy+angle"):
            raise InvalidInput(f"{arm.name} moves in a plane: axes must be 'xy' or 'xy+angle', got {self.axes!r}")
        return self

    @property
    def rows(self) -> int:
        """Number of equations a sample."""
        return ROWS[self.axes or ""]

    @property
    def positions(self) -> int:
        """Number of these that are about position [m]; the others are about rotation [rad]."""
        return 2 if self.axes in ("xy", "xy+angle") else 3

    @property
    def numbers(self) -> int:
        """Number of target columns a sample."""
        return {"xy": 2, "xyz": 3, "xy+angle": 11}.get(self.axes or "", 12)

    @property
    def travel(self) -> int:
        """Number of columns of ``travels``."""
        return self.positions + 3 * self.turns

    def targets(self, t: Times) -> Float[np.ndarray, "time numbers"]:
        """Return what ``errors`` compares with at times t [s]: position, then the rotation matrix by rows, if any."""
        positions, quaternions = self.path.at(t)
        wanted = [positions[:, :2] if self.axes in ("xy", "xy+angle") else positions]
        if self.axes in ("xy+angle", "xyz+z-axis", "pose"):
            assert quaternions is not None
            wanted.append(quaternion_to_matrix(quaternions).reshape(-1, 9))
        return np.concatenate(wanted, axis=1)

    def travels(self, t: Times) -> Float[np.ndarray, "time travels"]:
        """Return how far what is wanted goes from each of the times t [s] to the next, 0 from the last.

        Position [m], then the turn [rad] in world axes, if any: with "xyz+z-axis" the least that turns the z axis.
        """
        wanted = self.targets(t)
        size = self.positions
        found = [np.diff(wanted[:, :size], axis=0, append=wanted[-1:, :size])]
        if self.turns:
            rotations = wanted[:, size:].reshape(-1, 3, 3)
            later = np.concatenate([rotations[1:], rotations[-1:]])
            if self.axes == "xyz+z-axis":
                axis, cosine = np.cross(rotations[..., 2], later[..., 2]), (rotations[..., 2] * later[..., 2]).sum(-1)
                sine = np.linalg.norm(axis, axis=-1)
                angle_over_sine = np.where(sine < DUST, 1.0, np.arctan2(sine, cosine) / np.maximum(sine, DUST))
                found.append(angle_over_sine[:, None] * axis)
            else:
                found.append(rotation_vector(later @ rotations.swapaxes(-1, -2)))
        return np.concatenate(found, axis=1)

    def travelled(self, arm: Arm, links: LinkFrames, travels: Sequence[Component]) -> list[Component]:
        """Return a row of ``travels`` in the coordinates of ``errors``, as components."""
        found = list(travels[: self.positions])
        if self.turns:
            rotation, _ = frame_components(arm, links, _frame(arm, self.frame))
            x, y, z = travels[self.positions :]
            turn = apply_transposed(rotation, (x, y, z))
            found += [turn[i] for i in self._kept]
        return found

    def errors(
        self, arm: Arm, links: LinkFrames, wanted: Sequence[Component]
    ) -> tuple[list[Component], list[list[Component]]]:
        """Return (error, Jacobian rows) as components, all of them expressions or numbers.

        The Jacobian is that of the frame's motion in the same coordinates, so that J δq = error is Newton's step.
        """
        frame = _frame(arm, self.frame)
        rotation, position = frame_components(arm, links, frame)
        size = self.positions
        error = [minus(wanted[i], position[i]) for i in range(size)]
        if self.turns:
            turn = _turn(self.axes or "", rotation, _matrix(wanted[size:]))
            error += [turn[i] for i in self._kept]
        return error, self.slopes(arm, links)

    def slopes(self, arm: Arm, links: LinkFrames) -> list[list[Component]]:
        """Return the Jacobian rows of ``errors`` as components."""
        frame = _frame(arm, self.frame)
        rotation, position = frame_components(arm, links, frame)
        pairs = jacobian_components(arm, links, frame, position)
        jacobian = [[linear[i] for linear, _ in pairs] for i in range(self.positions)]
        if self.turns:
            spins = [apply_transposed(rotation, angular) for _, angular in pairs]
            jacobian += [[spin[i] for spin in spins] for i in self._kept]
        return jacobian

    def equations(self, arm: Arm, links: LinkFrames, wanted: Sequence[Component]) -> list[Component]:
        """Return smooth functions that vanish where the errors do; there their slopes are the Jacobian.

        Unlike the rotation vector, sines of the turn have derivatives of every order on the path itself, and the same
        first and second ones there. They vanish at half turns too: for motions that are on the path.
        """
        rotation, position = frame_components(arm, links, _frame(arm, self.frame))
        size = self.positions
        found = [minus(position[i], wanted[i]) for i in range(size)]
        if self.turns:
            sines = _sines(self.axes or "", multiply(transpose(_matrix(wanted[size:])), rotation))
            found += [sines[i] for i in self._kept]
        return found

    @property
    def turns(self) -> bool:
        """Whether the task asks for an orientation."""
        return self.axes in ("xy+angle", "xyz+z-axis", "pose")

    @property
    def _kept(self) -> tuple[int, ...]:
        """Which entries of the rotation vector count."""
        return {"xyz+z-axis": (0, 1), "xy+angle": (2,)}.get(self.axes or "", (0, 1, 2))


@lru_cache(maxsize=64)
def _frame(arm: Arm, name: str) -> Frame:
    return arm.frame(name)  # it searches and builds; Newton's method asks a thousand times


def _matrix(entries: Sequence[Component]) -> Matrix:
    return tuple(tuple(entries[3 * i : 3 * i + 3]) for i in range(3))  # type: ignore[return-value]


def _sines(axes: str, between: Matrix) -> Vector:
    """Return the axis times the sine of the turn that a rotation makes, or with "xyz+z-axis" its z axis makes."""
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = between
    if axes == "xyz+z-axis":
        return times(-1.0, yz), xz, 0.0
    return scale((minus(zy, yz), minus(xz, zx), minus(yx, xy)), 0.5)


def _turn(axes: str, rotation: Matrix, desired: Matrix) -> Vector:
    """Return the rotation vector in the frame's own axes that the task still wants."""
    between = multiply(transpose(rotation), desired)
    if axes == "xyz+z-axis":
        x, y, z = transpose(between)[2]
        sine = np.sqrt(plus(times(x, x), times(y, y)))
        factor = _angle_over_sine(sine, z)
        return where(_is_half_turn(sine, z), np.pi, times(-1.0, times(y, factor))), times(x, factor), 0.0
    vector = _sines(axes, between)
    trace = plus(plus(between[0][0], between[1][1]), between[2][2])
    sine, cosine = np.sqrt(dot(vector, vector)), times(0.5, minus(trace, 1.0))
    opposite, turn = _is_half_turn(sine, cosine), scale(vector, _angle_over_sine(sine, cosine))
    x, y, z = (where(opposite, half, part) for half, part in zip(_half_turn(between), turn, strict=True))
    return x, y, z


def _angle_over_sine(sine: Component, cosine: Component) -> Component:
    small = np.less(sine, DUST)
    found: Component = where(small, 1.0, np.arctan2(sine, cosine) / where(small, 1.0, sine))
    return found


def _is_half_turn(sine: Component, cosine: Component) -> Component:
    truth: Component = np.multiply(np.less(sine, DUST), np.less(cosine, 0.0))
    return truth


def _half_turn(between: Matrix) -> Vector:
    """Return the rotation vector of a half turn: R + 1 = 2 a aᵀ, so that any of its columns gives the axis a."""
    x, y, z = (tuple(plus(between[i][j], float(i == j)) for i in range(3)) for j in range(3))
    # Of the columns the longest, which has the largest entry on the diagonal; the others may vanish.
    found = _either(np.less_equal(z[2], y[1]), y, z)
    found = _either(np.less_equal(z[2], x[0]) * np.less_equal(y[1], x[0]), x, found)
    return scale(found, np.pi / np.sqrt(dot(found, found)))


def _either(condition: Component, first: Sequence[Component], second: Sequence[Component]) -> Vector:
    x, y, z = (where(condition, one, other) for one, other in zip(first, second, strict=True))
    return x, y, z

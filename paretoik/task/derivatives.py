"""Derivatives of what users define: a motion made of expressions, and functions of motions traced through it.

An objective is one NumPy function. Called with a ``TracedMotion`` it writes down what it computes, from which exact
derivatives of any order follow. Most functions look at every sample by itself: positions, velocities, accelerations and
jerks of one sample give one value. Those are traced once for all samples; the others with every sample in sight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

import numpy as np

from paretoik.autodiff.tape import Expression, as_entry
from paretoik.autodiff.tracing import NotLocal, Trace, TracedArray
from paretoik.errors import InvalidInput
from paretoik.robot.arm import Arm
from paretoik.robot.components import Component
from paretoik.robot.dynamics import energy_components, torque_components
from paretoik.robot.kinematics import frame_components, link_frames, node_components
from paretoik.task.differences import Differences
from paretoik.task.motion_task import MotionTask
from paretoik.task.obstacles import Obstacle, to_surface
from paretoik.task.task import Task


@dataclass(frozen=True, eq=False)
class TracedMotion:
    """What a function of motions sees where derivatives are taken: the face of ``Motion``, made of expressions.

    ``duration`` [s] is that of the motion, or of what stands for it.
    """

    task: MotionTask
    trace: Trace
    q: TracedArray
    dq: TracedArray
    ddq: TracedArray
    jerk: TracedArray
    duration: float

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # what Python asks to see what an object can do
            raise AttributeError(name)
        raise InvalidInput(f"motion.{name} has no derivative here")

    def __len__(self) -> int:
        raise InvalidInput("len(motion) has no derivative here: all motions of a batch are wanted at once")

    def __getitem__(self, index: Any) -> Any:
        raise InvalidInput("motion[...] has no derivative here: all motions of a batch are wanted at once")

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self.task.arm

    @property
    def tasks(self) -> tuple[Task, ...]:
        """The tasks that the motion follows."""
        return self.task.tasks

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The obstacles."""
        return self.task.obstacles

    @property
    def link_radius(self) -> float:
        """Radius of the links [m]."""
        return self.task.link_radius

    @property
    def differences(self) -> Differences:
        """How rates and integrals are taken."""
        return self.task.differences

    @property
    def cyclic(self) -> bool:
        """Whether the motion ends as it starts."""
        return self.task.cyclic

    @property
    def time(self) -> np.ndarray:
        """Sample times (time,) [s]."""
        return self.task.times

    @property
    def weights(self) -> np.ndarray:
        """Weights (time,) [s] of integrals over the samples."""
        return self.task.weights

    @cached_property
    def torque(self) -> TracedArray:
        """As ``Motion.torque``."""
        return self._by_sample(lambda q, dq, ddq: torque_components(self.arm, q, dq, ddq))

    @property
    def power(self) -> TracedArray:
        """As ``Motion.power``."""
        product: TracedArray = self.torque * self.dq
        return product

    @cached_property
    def kinetic_energy(self) -> TracedArray:
        """As ``Motion.kinetic_energy``."""
        return self._by_sample(lambda q, dq, _: energy_components(self.arm, q, dq))[..., 0]

    @cached_property
    def tool(self) -> TracedArray:
        """As ``Motion.tool``."""
        return self._by_sample(lambda q, *_: list(self._tool(q)[1][: 2 if self.arm.is_planar else 3]))

    @cached_property
    def tool_rotation(self) -> TracedArray:
        """As ``Motion.tool_rotation``."""
        flat = self._by_sample(lambda q, *_: [value for row in self._tool(q)[0] for value in row])
        return self._parted(flat, 3, 3)

    @cached_property
    def links(self) -> TracedArray:
        """As ``Motion.links``."""
        flat = self._by_sample(lambda q, *_: node_components(self.arm, q))
        return self._parted(flat, -1, 3)

    @cached_property
    def manipulability(self) -> TracedArray:
        """As ``Motion.manipulability``."""
        flat = self._by_sample(
            lambda q, *_: [
                slope for task in self.tasks for row in task.slopes(self.arm, link_frames(self.arm, q)) for slope in row
            ]
        )
        jacobian = self._parted(flat, self.task.rows, self.arm.dof)
        found: TracedArray = np.sqrt(np.maximum(np.linalg.det(jacobian @ jacobian.swapaxes(-1, -2)), 0.0))
        return found

    @cached_property
    def clearance(self) -> TracedArray:
        """As ``Motion.clearance``."""
        if not self.obstacles:
            raise InvalidInput("motion.clearance wants obstacles, but the problem has none")
        nodes = [self.links[..., axis] for axis in range(3)]
        starts, ends = [node[..., :-1] for node in nodes], [node[..., 1:] for node in nodes]
        surface: Any = to_surface  # of arrays; it takes expressions as well
        gaps = [surface(obstacle, starts, ends) - self.link_radius for obstacle in self.obstacles]
        least: TracedArray = reduce(np.minimum, [gap.min(-1) for gap in gaps])
        return least

    def integral(self, series: Any) -> Any:
        """As ``Motion.integral``."""
        if self.trace.samples is not None:
            raise NotLocal("integrates over time")
        return (series * self.task.weights).sum(-1)

    def _tool(self, q: list[Component]) -> Any:
        return frame_components(self.arm, link_frames(self.arm, q), self.arm.frame("tool"))

    def _by_sample(self, kernel: Callable[..., list[Component]]) -> TracedArray:
        """Run a kernel of columns on every sample that is in sight."""
        joints = [part.entries.reshape(-1, self.arm.dof) for part in (self.q, self.dq, self.ddq)]
        rows = [kernel(*(list(part[i]) for part in joints)) for i in range(len(joints[0]))]
        found = np.empty((len(rows), len(rows[0])), dtype=object)
        for i, row in enumerate(rows):
            found[i] = row
        return TracedArray(self.trace, found.reshape(*self.q.entries.shape[:-1], -1), shared=True)

    def _parted(self, flat: TracedArray, *shape: int) -> TracedArray:
        return flat.reshape(*flat.shape[:-1], *shape)


def traced_sample(task: MotionTask, *, duration: float | None = None) -> TracedMotion:
    """Return one sample of a motion of a task, for functions that look at every sample by itself.

    ``duration`` [s] is what means over time are taken over; by default the task's own.
    """
    trace = Trace(len(task.times))
    lasting = float(np.ptp(task.times)) if duration is None else duration
    q, dq, ddq, jerk = (trace.inputs(task.arm.dof) for _ in range(4))
    return TracedMotion(task, trace, q, dq, ddq, jerk, lasting)


def traced_whole(task: MotionTask) -> TracedMotion:
    """Return a whole motion of a task with every sample in sight, for functions that look from one at another."""
    trace = Trace(None)
    q, dq, ddq, jerk = (trace.inputs(len(task.times), task.arm.dof) for _ in range(4))
    return TracedMotion(task, trace, q, dq, ddq, jerk, float(np.ptp(task.times)))


def whole(motion: TracedMotion, what: str, function: Callable[[Any], Any], form: str) -> list[Expression | float]:
    """Return what a function computes of a whole motion: one value, or one a sample where its form is a series.

    Raises InvalidInput, naming the function and what it did, where its derivative cannot be had.
    """
    wanted = motion.time.shape if form in ("integral", "peak") else ()
    try:
        value = function(motion)
        found = value if isinstance(value, TracedArray) else np.asarray(value)
        if found.dtype.kind not in "fiub":
            raise InvalidInput(f"must return real numbers, got {found.dtype if found.ndim else repr(value)}")
        if found.shape != wanted:
            raise InvalidInput(f"({form}) must return shape {wanted} where derivatives are taken, got {found.shape}")
    except InvalidInput as error:
        raise InvalidInput(f"{what}: {error}") from None
    return list((found.entries if isinstance(found, TracedArray) else found).ravel())


def local(motion: TracedMotion, what: str, function: Callable[[Any], Any]) -> Expression | float | None:
    """Return what a function computes at one sample; None where it looks from one sample at another.

    Raises InvalidInput, naming the function and what it did, where its derivative cannot be had.
    """
    try:
        return _series(motion, function(motion))
    except NotLocal:
        return None
    except InvalidInput as error:
        raise InvalidInput(f"{what}: {error}") from None


def _series(motion: TracedMotion, value: Any) -> Expression | float:
    tape = motion.trace.tape
    found = value if isinstance(value, TracedArray) else np.asarray(value)
    if found.dtype.kind not in "fiub":
        raise InvalidInput(f"must return real numbers, got {found.dtype if found.ndim else repr(value)}")
    if isinstance(found, TracedArray) and found.entries.shape == ():
        return Expression(tape, as_entry(tape, found.entries))
    if isinstance(found, np.ndarray) and found.shape in ((), motion.time.shape):
        return motion.trace.parameter(found) if found.ndim else float(found)
    raise InvalidInput(f"must return one number a sample where derivatives are taken, got shape {found.shape}")

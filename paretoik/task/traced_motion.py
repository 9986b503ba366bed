"""A motion of expressions, which gives exact derivatives of functions.

An objective is one NumPy function. A call with a ``TracedMotion`` records its computation, from which exact
derivatives of any order follow. Most functions depend on one sample at a time: position, velocity, acceleration and
jerk of a sample give one value. They are traced once for all samples; others are traced with all samples as inputs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache, reduce
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.differentiation import dependencies
from paretoik.autodiff.opcodes import PIECEWISE, Op
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.autodiff.tracing import NotLocal, Trace, TracedArray
from paretoik.collision.obstacles import LinkRadius, Obstacle, distance_components, radii
from paretoik.errors import InvalidInput, ParetoikError
from paretoik.inputs import likely_spelling, limited_call, user_function
from paretoik.robot.arm import Arm
from paretoik.robot.arm_arguments import TOOL_FRAME
from paretoik.robot.components import Component
from paretoik.robot.dynamics import energy_components, torque_components
from paretoik.robot.kinematics import frame_components, jacobian_components, link_frames, node_components
from paretoik.task.differences import Differences
from paretoik.task.motion import Motion
from paretoik.task.task import Task, path_jacobian

KINKS = PIECEWISE | {Op.ABSOLUTE}


@dataclass(frozen=True, eq=False)
class TracedMotion:
    """The attributes of ``Motion`` as expressions.

    steps: intervals (time − 1,) [s] of a motion with its own times; their sum if one sample is traced

    Functions get this motion when derivatives are taken.
    """

    task: Any  # MotionTask, or an object with the same attributes
    trace: Trace
    q: TracedArray
    dq: TracedArray
    ddq: TracedArray
    jerk: TracedArray
    seconds: float | None  # duration [s]; None for a motion with its own times, which follows no task
    steps: TracedArray | None = None

    def __getattr__(self, name: str) -> Any:
        if name in ("arm", "obstacles", "link_radius", "differences", "cyclic"):
            return getattr(self.task, name)
        if name.startswith("__"):  # protocols that Python looks for
            raise AttributeError(name)
        names = [each for each in {*dir(Motion), *Motion.__dataclass_fields__} if not each.startswith("_")]
        if name not in names:
            raise InvalidInput(f"motion.{name} must be a field of motions, got none{likely_spelling(name, names)}")
        raise InvalidInput(f"motion.{name} has no derivative here")

    def __len__(self) -> int:
        raise InvalidInput("len(motion) has no derivative here: functions must take all motions of a batch at once")

    def __getitem__(self, index: Any) -> Any:
        raise InvalidInput("motion[...] has no derivative here: functions must take all motions of a batch at once")

    @property
    def tasks(self) -> tuple[Task, ...]:
        """The tasks that the motion follows."""
        return () if self.seconds is None else self.task.tasks

    @cached_property
    def time(self) -> Any:
        """Times [s] at which functions are evaluated: the task's instants, or the motion's own."""
        if self.seconds is not None:
            return self.task.instants
        times: list[Any] = list(accumulate(self._own_steps, initial=0.0))
        return TracedArray(self.trace, np.array(times, dtype=object), shared=True)

    @cached_property
    def velocity_bounds(self) -> TracedArray:
        """As ``Motion.velocity_bounds``, but a sample has the bound of the interval after it."""
        if self.seconds is None or self.differences != "spline":
            return self.dq
        half = np.zeros(len(self.task.instants))
        half[:-1:2] = np.diff(self.task.times) / 2
        factor: Any = self.trace.parameter(half) if self.trace.samples is not None else half[:, None]
        return TracedArray(self.trace, self.dq.entries + self.ddq.entries * factor, shared=True)

    @property
    def weights(self) -> Any:
        """As ``Motion.weights``."""
        if self.seconds is not None:
            return self.task.weights
        return TracedArray(self.trace, np.array([0.0, *self._own_steps], dtype=object), shared=True)

    @property
    def duration(self) -> Any:
        """As ``Motion.duration``."""
        if self.seconds is not None:
            return np.float64(self.seconds)
        return self.time[-1] if self.trace.samples is None else OwnDuration(self.steps)

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
        return self._reshape(flat, 3, 3)

    @cached_property
    def links(self) -> TracedArray:
        """As ``Motion.links``."""
        flat = self._by_sample(lambda q, *_: node_components(self.arm, q))
        return self._reshape(flat, -1, 3)

    @cached_property
    def manipulability(self) -> TracedArray:
        """As ``Motion.manipulability``, but without its clip at 0, a kink that matters only for rounding errors."""

        def entries(q: list[Component], *_: object) -> list[Component]:
            if self.tasks:
                return path_jacobian(self.arm, self.tasks, q)
            links, frame = link_frames(self.arm, q), self.arm.frame(TOOL_FRAME)
            columns = jacobian_components(self.arm, links, frame, frame_components(self.arm, links, frame)[1])
            rows = [(0, 0), (0, 1)] if self.arm.is_planar else [(part, axis) for part in (0, 1) for axis in range(3)]
            return [column[part][axis] for part, axis in rows for column in columns]

        flat = self._by_sample(entries)
        jacobian = self._reshape(flat, -1, self.arm.dof)
        measure: TracedArray = np.sqrt(np.linalg.det(jacobian @ jacobian.swapaxes(-1, -2)))
        return measure

    @cached_property
    def clearance(self) -> TracedArray:
        """As ``Motion.clearance``."""
        if not self.obstacles:
            raise InvalidInput("motion.clearance must have obstacles, got a problem without any")
        smallest: TracedArray = reduce(np.minimum, [distance.min(-1) for distance in self.distances])
        return smallest

    @cached_property
    def distances(self) -> list[TracedArray]:
        """Distances of every link (..., links) from each obstacle [m]; clearance is the smallest."""
        nodes = [self.links[..., axis] for axis in range(3)]
        starts, ends = [node[..., :-1] for node in nodes], [node[..., 1:] for node in nodes]
        distance: Any = distance_components  # typed for arrays, but takes expressions too
        return [distance(obstacle, starts, ends) - radii(self.link_radius) for obstacle in self.obstacles]

    def integral(self, series: Any) -> Any:
        """As ``Motion.integral``."""
        if self.trace.samples is not None:
            raise NotLocal("integrates over time")
        return (series * self.weights).sum(-1)

    @property
    def _own_steps(self) -> list[Any]:
        if self.steps is None or self.trace.samples is not None:
            raise NotLocal("looks at times, which depend on all samples")
        return list(self.steps.entries)

    def _tool(self, q: list[Component]) -> Any:
        return frame_components(self.arm, link_frames(self.arm, q), self.arm.frame(TOOL_FRAME))

    def _by_sample(self, kernel: Callable[..., list[Component]]) -> TracedArray:
        joints = [part.entries.reshape(-1, self.arm.dof) for part in (self.q, self.dq, self.ddq)]
        rows = [kernel(*(list(part[i]) for part in joints)) for i in range(len(joints[0]))]
        values = np.empty((len(rows), len(rows[0])), dtype=object)
        values[:] = rows
        return TracedArray(self.trace, values.reshape(*self.q.entries.shape[:-1], -1), shared=True)

    def _reshape(self, flat: TracedArray, *shape: int) -> TracedArray:
        return flat.reshape(*flat.shape[:-1], *shape)


@dataclass(frozen=True, eq=False)
class OwnDuration:
    """The duration of motions with their own times, traced at one sample."""

    number: TracedArray | None

    def __getitem__(self, key: Any) -> Any:
        if key != (..., None):
            raise NotLocal("looks at the duration")
        return self.number

    def __array__(self, *args: Any, **settings: Any) -> np.ndarray:
        raise NotLocal("looks at the duration")

    def __array_ufunc__(self, *args: Any, **settings: Any) -> Any:
        raise NotLocal("looks at the duration")


def trace_sample(
    task: Any,
    *,
    scales: Float[np.ndarray, " dof"] | float = 1.0,
    duration: float | None = None,
    own_times: bool = False,
) -> TracedMotion:
    """Return one sample of a motion of a task.

    scales: divisors of the inputs, which are joints and their rates
    duration: divisor of means over time [s], None for the task's duration
    own_times: whether motions have their own times and follow no task; the duration is then the last input

    The sample is for functions that depend on one sample at a time.
    """
    seconds = float(np.ptp(task.times)) if duration is None else duration
    return _trace_inputs(task, Trace(len(task.instants)), (), scales, seconds, () if own_times else None)


def trace_sample_again(motion: TracedMotion, scales: Float[np.ndarray, " dof"] | float = 1.0) -> TracedMotion:
    """Return one sample of another motion of the task, on the same tape and with its own inputs."""
    return _trace_inputs(motion.task, motion.trace, (), scales, motion.seconds, None)


def trace_motion(
    task: Any, *, scales: Float[np.ndarray, " dof"] | float = 1.0, own_times: bool = False
) -> TracedMotion:
    """Return a whole motion of a task, for functions that combine several samples.

    Parameters are those of ``trace_sample``; with ``own_times``, the intervals are the last inputs.
    """
    count = len(task.instants)
    steps = (count - 1,) if own_times else None
    return _trace_inputs(task, Trace(None), (count,), scales, float(np.ptp(task.times)), steps)


def _trace_inputs(
    task: Any,
    trace: Trace,
    shape: tuple[int, ...],
    scales: Float[np.ndarray, " dof"] | float,
    seconds: float | None,
    steps: tuple[int, ...] | None,
) -> TracedMotion:
    """Return a motion of new inputs: joints and their rates of this ``shape``, then ``steps``, if any."""

    def inputs(factor: Any, *size: int) -> TracedArray:
        return TracedArray(trace, (factor * trace.inputs(*size)).entries, shared=True)

    q, dq, ddq, jerk = (inputs(scales, *shape, task.arm.dof) for _ in range(4))
    if steps is None:
        return TracedMotion(task, trace, q, dq, ddq, jerk, seconds)
    return TracedMotion(task, trace, q, dq, ddq, jerk, None, inputs(1.0, *steps))


def trace_motion_function(
    motion: TracedMotion, name: str, function: Callable[[Any], Any], form: str
) -> list[Expression | float]:
    """Return the value of a function of a whole motion, or one value per sample if it returns a series.

    Raises InvalidInput if it has no derivative, EvaluationFailed if it raises.
    """
    shape = motion.time.shape if form in ("integral", "peak") else ()
    wish = f"(time,), here {shape}," if shape else "()"
    try:
        array = _real_value(motion, name, function)
        if array.shape != shape:
            raise InvalidInput(f"({form}) must return shape {wish} where derivatives are taken, got {array.shape}")
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {error}") from None
    return list((array.entries if isinstance(array, TracedArray) else array).ravel())


def trace_sample_function(motion: TracedMotion, name: str, function: Callable[[Any], Any]) -> Expression | float | None:
    """Return the value of a function at one sample; None if it combines several.

    Raises InvalidInput if it has no derivative, EvaluationFailed if it raises.
    """
    tape = motion.trace.tape
    try:
        array = _real_value(motion, name, function)
        if isinstance(array, TracedArray) and array.entries.shape == ():
            return Expression(tape, as_entry(tape, array.entries))
        if isinstance(array, np.ndarray) and array.shape in ((), (motion.trace.samples,)):
            return motion.trace.parameter(array) if array.ndim else float(array)
        raise InvalidInput(f"must return one number per sample where derivatives are taken, got shape {array.shape}")
    except NotLocal:
        return None
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {error}") from None


def _real_value(motion: TracedMotion, name: str, function: Callable[[Any], Any]) -> TracedArray | np.ndarray:
    """Return a function's value. Raises InvalidInput unless it is real, EvaluationFailed if the function raises."""
    with user_function(name), limited_call(name):
        value = function(motion)
    array = value if isinstance(value, TracedArray) else np.asarray(value)
    if array.dtype.kind not in "fiub":
        raise InvalidInput(f"must return real numbers, got {array.dtype if array.ndim else repr(value)}")
    return array


class OneInterval(NamedTuple):
    """A motion of one interval, for tracing functions of an instant."""

    arm: Arm
    tasks: tuple[Task, ...]
    obstacles: tuple[Obstacle, ...]
    link_radius: LinkRadius
    differences: Differences = "spline"
    cyclic: bool = False
    times: np.ndarray = np.array([0.0, 1.0])
    instants: np.ndarray = np.array([0.0, 0.5, 1.0])
    weights: np.ndarray = np.array([1.0, 4.0, 1.0]) / 6


@lru_cache(maxsize=64)
def has_kinks(
    term: Any, arm: Arm, tasks: tuple[Task, ...], obstacles: tuple[Obstacle, ...], link_radius: LinkRadius
) -> bool:
    """Return whether a function of an instant has kinks; False if it cannot be traced."""
    motion = trace_sample(OneInterval(arm, tasks, obstacles, link_radius))
    try:
        value = trace_sample_function(motion, "kinks", term.function)
    except ParetoikError:
        return False
    tape = motion.trace.tape
    return value is not None and any(tape.entries[i][0] in KINKS for i in dependencies(tape, [as_entry(tape, value)]))

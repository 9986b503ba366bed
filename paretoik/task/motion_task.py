"""The motion problem of all solvers: arm, tasks, objectives, limits, start and end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial

import numpy as np
from jaxtyping import Float, Int
from numpy.lib.stride_tricks import sliding_window_view

from paretoik.arrays import JointPaths, Objectives, Times, read_only
from paretoik.collision.obstacles import LinkRadius, Obstacle, closest_pair
from paretoik.errors import EvaluationFailed, Infeasible
from paretoik.inputs import warn_of_odd_objectives
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import characteristic_length
from paretoik.stop_flag import check_interruption
from paretoik.tables import represented
from paretoik.task.differences import (
    Derivatives,
    Differences,
    quadrature_weights,
    simpson_weights,
    with_midpoints,
)
from paretoik.task.limits import LIMIT_TOLERANCE, Bounds, Constraint, limit_ranges, relative_violation, usual_ranges
from paretoik.task.motion import Motion
from paretoik.task.objectives import Objective
from paretoik.task.path import Path
from paretoik.task.path_shapes import SmoothCurve
from paretoik.task.task import Task, path_targets

# Motions between their samples: the projected curve on finer grids, and its largest values.

Pieces = Float[np.ndarray, "pieces instants"]
Columns = Float[np.ndarray, "pieces instants columns"]


@dataclass(frozen=True, kw_only=True)
class RefinementOptions:
    """Settings of grids between samples."""

    steps: int = 8  # number of steps of an interval between two samples, and of a step that is divided again
    width: int = 6  # number of points of a finite difference
    divisions: int = 64  # largest number of steps that are divided at once
    rounds: int = 12  # largest number of divisions
    rounding: float = 1e-10  # share of a limit's range by which a bound may exceed the largest value
    share: float = 1e-3  # share of the largest value by which a bound may exceed it


OPTIONS = RefinementOptions()


def finer_motion(motions: Motion, refinement: int = OPTIONS.steps) -> Motion:
    """Return the projected curves of one task's motions (*batch, time, dof) on a finer grid.

    Velocities and accelerations are the curve's, for any ``differences``. Raises Infeasible off the path.
    """
    time = motions.time.reshape(-1, motions.time.shape[-1])[0]
    curves = curve_on(motions, divide(time, refinement))

    def join(values: np.ndarray) -> np.ndarray:
        shape = (*motions.q.shape[:-2], -1, values.shape[-1])
        return np.concatenate([values[..., :-1, :].reshape(shape), values[..., -1, -1:, :]], axis=-2)

    q, dq, ddq, jerk = map(join, curves)
    derivatives = Derivatives(dq=dq, ddq=ddq, jerk=jerk, velocity_bounds=dq)
    finer = np.append(divide(time, refinement)[:, :-1], time[-1])
    return replace(motions, time=finer, q=q, derivatives=derivatives)


def divide(time: Float[np.ndarray, " time"], steps: int = OPTIONS.steps) -> Pieces:
    """Return the times of all intervals, each divided into steps."""
    return np.linspace(time[:-1], time[1:], steps + 1, axis=1)


def curve_on(motions: Motion, times: Pieces) -> tuple[Float[np.ndarray, "*batch pieces instants dof"], ...]:
    """Return position, velocity, acceleration and jerk of motions' curves at times.

    Times are evenly spaced in each piece. The jerk is a difference. If the path has no exact rates, velocity and
    acceleration are the spline's plus differences of the small correction onto the path.
    """
    steps = (times[:, -1] - times[:, 0]) / (times.shape[1] - 1)
    shape = (*motions.q.shape[:-2], *times.shape, motions.arm.dof)

    def slope(values: np.ndarray, order: int = 1) -> np.ndarray:
        return difference_matrix(times.shape[1], order) @ values / steps[:, None, None] ** order

    if all(isinstance(task.path.curve, SmoothCurve) for task in motions.tasks):
        q, dq, ddq = (part.reshape(shape) for part in motions.state(times.ravel()))
    else:
        spline = [part.reshape(shape) for part in motions.state(times.ravel(), project=False)]
        q = motions.at(times.ravel()).reshape(shape)
        dq, ddq = (spline[order] + slope(q - spline[0], order) for order in (1, 2))
    return q, dq, ddq, slope(ddq)


def largest_between(evaluate: Callable[[Pieces], Columns], times: Pieces) -> float:
    """Return an upper bound, at least 0, of values that are continuous within pieces.

    Between two neighbours, a value exceeds the larger neighbour by at most an eighth of the squared step times the
    curvature. The curvature is estimated as the largest second difference nearby plus the spread of the second
    differences. The estimate is at least doubled, to include kinks. A step is divided if its bound exceeds the largest
    value by more than rounding.
    """
    values, upper = evaluate(times), np.float64(0.0)
    largest = values.max(initial=0.0)
    begin, end, bounds = _step_bounds(times, values)
    for _ in range(OPTIONS.rounds):
        open_ = bounds > largest + np.maximum(OPTIONS.rounding, OPTIONS.share * largest)
        upper = np.maximum(upper, bounds[~open_].max(initial=0.0))
        begin, end, bounds = begin[open_], end[open_], bounds[open_]
        if not len(bounds):
            break
        order = np.argsort(-bounds)
        divided, others = order[: OPTIONS.divisions], order[OPTIONS.divisions :]
        times = np.linspace(begin[divided], end[divided], OPTIONS.steps + 1, axis=1)
        values = evaluate(times)
        largest = np.maximum(largest, values.max())
        parts = zip((begin, end, bounds), _step_bounds(times, values), strict=True)
        begin, end, bounds = (np.concatenate([whole[others], part]) for whole, part in parts)
    upper = np.max([upper, largest, bounds.max(initial=0.0)])
    return 0.0 if upper <= OPTIONS.rounding else float(upper)  # NaN if a value is NaN


def _step_bounds(times: Pieces, values: Columns) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return every step's begin and end, and an upper bound of its values."""
    bends = np.pad(np.diff(values, 2, axis=1), ((0, 0), (2, 2), (0, 0)), mode="edge")
    around = sliding_window_view(bends, 4, axis=1)
    low, high = around.min(axis=-1), around.max(axis=-1)
    share = np.full((values.shape[1] - 1, 1), 1 / 4)
    share[[0, -1]] = 1 / 2  # at the ends of a piece only one second difference sees a kink
    bounds = np.maximum(values[:, :-1], values[:, 1:]) + share * (np.maximum(-low, 0.0) + high - low)
    return times[:, :-1].ravel(), times[:, 1:].ravel(), bounds.max(axis=-1, initial=0.0).ravel()


@cache
def difference_matrix(points: int, order: int) -> np.ndarray:
    """Return the matrix of finite differences from the nearest points, which are 1 apart."""
    width = min(OPTIONS.width, points)
    first = np.clip(np.arange(points) - width // 2, 0, points - width)
    matrix = np.zeros((points, points))
    for i, begin in enumerate(first):
        offsets = np.arange(begin, begin + width) - float(i)
        right = np.zeros(width)
        right[order] = order  # order! = order, since the order is 1 or 2
        matrix[i, begin : begin + width] = np.linalg.solve(np.vander(offsets, increasing=True).T, right)
    return read_only(matrix)


# The motion problem of all solvers.


@dataclass(frozen=True, kw_only=True)
class SampleOptions:
    """Settings of checks for under-resolved samples, and of added samples."""

    steps: int = 50  # number of steps between samples on the grid of the curve
    doublings: int = 3  # largest number of times that the intervals of a path are doubled if a value is under-resolved
    helped: float = 0.5  # largest ratio of the median errors after and before doubling, for doubling again


SAMPLES = SampleOptions()


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class MotionTask:
    """One checked motion problem, made with ``motion_task``."""

    arm: Arm  # arm with the position limits of the problem, the widest ones if they vary along the path
    tasks: tuple[Task, ...]
    objectives: tuple[Objective, ...]
    constraints: tuple[Constraint, ...]
    bounds: dict[str, Bounds]  # arrays (1 or time, dof, 2) of limits by kind
    obstacles: tuple[Obstacle, ...]
    link_radius: LinkRadius
    min_clearance: float
    start: Float[np.ndarray, " dof"] | None  # joint positions (dof,), or None for a free start
    ends_at_rest: bool
    cyclic: bool
    differences: Differences

    @property
    def times(self) -> Times:
        """Sample times (time,) [s]."""
        return self.tasks[0].path.times

    @cached_property
    def instants(self) -> Times:
        """Times [s] of objectives and limits: samples, for splines also midpoints."""
        return with_midpoints(self.times) if self.differences == "spline" else self.times

    @property
    def stride(self) -> int:
        """Number of instants from one sample to the next."""
        return 2 if self.differences == "spline" else 1

    @cached_property
    def weights(self) -> Times:
        """Weights [s] of integrals over the instants."""
        if self.differences == "spline":
            return simpson_weights(self.instants)
        return quadrature_weights(self.times, self.differences)

    @property
    def ties_end(self) -> bool:
        """Whether rest at the end makes the last sample the posture nearest to the one before."""
        return self.ends_at_rest and self.differences != "spline"

    @property
    def rows(self) -> int:
        """Number of task equations per sample."""
        return sum(task.rows for task in self.tasks)

    @property
    def redundancy(self) -> int:
        """Number of joints beyond the task equations."""
        return self.arm.dof - self.rows

    @cached_property
    def targets(self) -> Float[np.ndarray, "time numbers"]:
        """Task targets of every sample, as ``Task.targets`` gives them."""
        return path_targets(self.tasks, self.times)

    def motion(self, q: JointPaths) -> Motion:
        """Return joint positions (*batch, time, dof) as motions of this task."""
        return Motion(
            arm=self.arm,
            time=self.times,
            q=q,
            tasks=self.tasks,
            obstacles=self.obstacles,
            link_radius=self.link_radius,
            differences=self.differences,
            cyclic=self.cyclic,
            ends_at_rest=self.ends_at_rest,
        )

    def _with_paths(self, change: Callable[[Path], Path]) -> MotionTask:
        tasks = tuple(replace(task, path=change(task.path)) for task in self.tasks)
        bounds = {kind: self.bounds_at(kind, tasks[0].path.times) for kind in self.bounds}
        return replace(self, tasks=tasks, bounds=bounds)

    def subsample(self, samples: int) -> MotionTask:
        """Return the same task at some of its samples, ends included. Raises InvalidInput."""
        return self._with_paths(lambda path: path.subsample(samples))

    def truncate(self, samples: int) -> MotionTask:
        """Return the task of the first ``samples`` samples, not cyclic. Raises InvalidInput."""
        if samples == len(self.times):
            return self
        return replace(self._with_paths(lambda path: path.truncate(samples)), cyclic=False)

    def standing(self, times: Times, sample: int = 0) -> MotionTask:
        """Return the task of a tool that rests at a sample's target, with its own ``times``."""
        tasks = tuple(replace(task, path=task.path.standing(times, sample)) for task in self.tasks)
        bounds = {kind: limits[min(sample, len(limits) - 1), None] for kind, limits in self.bounds.items()}
        return replace(self, tasks=tasks, bounds=bounds, cyclic=False)

    def resample(self, samples: int) -> MotionTask:
        """Return the same task at evenly spaced samples; limits along it are interpolated."""
        return self._with_paths(lambda path: path.resample(samples))

    def with_midpoints(self) -> MotionTask:
        """Return the task with midpoints of its intervals added; limits along it are interpolated."""
        return self._with_paths(Path.with_midpoints)

    @cached_property
    def limited_joints(self) -> dict[str, Int[np.ndarray, " limited"]]:
        """Indices of joints with limits, by kind, in the order of ``violations``."""
        return {kind: np.flatnonzero(np.isfinite(each).any(axis=(0, 2))) for kind, each in self.bounds.items()}

    @cached_property
    def limit_joints(self) -> tuple[tuple[str, int], ...]:
        """Kind and joint of each column of ``violations``; name and −1 for a limit that is not on a joint."""
        joints = [(kind, int(joint)) for kind, joints in self.limited_joints.items() for joint in joints]
        others = [*["clearance"] * bool(self.obstacles), *(each.name for each in self.constraints)]
        return (*joints, *((name, -1) for name in others))

    @cached_property
    def limit_names(self) -> tuple[str, ...]:
        """A name for each column of ``violations``."""
        return tuple(f"{kind} of {self.arm.joint_names[j]}" if j >= 0 else kind for kind, j in self.limit_joints)

    def violations(self, motion: Motion) -> Float[np.ndarray, "*batch limits"]:
        """Return every limit's largest violation (*batch, limits) as a share of its range; at most 0 if satisfied."""
        motion = motion.instants
        columns = [shares.max(axis=-2) for shares in self._limit_shares(motion)]
        columns += [each.violation(motion)[..., None] for each in self.constraints]
        return np.concatenate(columns, axis=-1) if columns else np.zeros((*motion.q.shape[:-2], 0))

    def _limit_shares(self, motion: Motion) -> list[Float[np.ndarray, "*batch instants limits"]]:
        """Return the violations at every instant: an array per joint limit, and one for clearance."""
        columns = [
            relative_violation(kind, self.bounds_at(kind, motion.time), motion)[..., joints]
            for kind, joints in self.limited_joints.items()
        ]
        if self.obstacles:
            columns.append(((self.min_clearance - motion.clearance) / self.clearance_range)[..., None])
        return columns

    def bounds_at(
        self, kind: str, time: Float[np.ndarray, "*batch instants"]
    ) -> Float[np.ndarray, "*batch #time dof 2"]:
        """Return the limits of a kind at times. Limits that vary along the path are linear between samples."""
        bounds = self.bounds[kind]
        if len(bounds) == 1 or np.array_equal(time, self.times):
            return bounds
        last = np.clip(np.searchsorted(self.times, time, side="right"), 1, len(self.times) - 1)
        share = ((time - self.times[last - 1]) / np.diff(self.times)[last - 1])[..., None, None]
        before, after = np.where(share < 1, bounds[last - 1], 0.0), np.where(share > 0, bounds[last], 0.0)
        return np.where(share < 1, 1 - share, 1.0) * before + np.where(share > 0, share, 1.0) * after

    def limit_ranges(self, kind: str, bounds: Bounds) -> Float[np.ndarray, "*times dof"]:
        """Return the divisors of violations of a kind of limit."""
        return limit_ranges(bounds[..., 0], bounds[..., 1], usual_ranges(kind, self.arm, float(np.ptp(self.times))))

    @property
    def clearance_range(self) -> float:
        """Divisor of violations of clearance [m]: the required clearance, at least 1 % of the arm's length."""
        return max(self.min_clearance, 0.01 * characteristic_length(self.arm))

    def violation_between(self, motions: Motion) -> Float[np.ndarray, " points"]:
        """Return an upper bound of the violation between samples, at least 0.

        The bound holds at any time of the motions' curves, for joint limits, clearance and constraints of the form
        "peak". It exceeds their violation by at most 0.1 %. It is correct if ``largest_between`` estimates curvatures
        correctly: there is no proof, but no finer grid found a larger violation. It is infinite if a motion leaves its
        path between samples.
        """
        peaks = [each for each in self.constraints if each.form == "peak"]

        def shares(motion: Motion, times: Pieces) -> Columns:
            q, dq, ddq, jerk = curve_on(motion, times)
            inner = times.copy()  # a limit that begins or ends at a sample applies only on its side of the sample
            inner[:, [0, -1]] += [1e-9, -1e-9] * (times[:, -1:] - times[:, :1])
            derivatives = Derivatives(dq=dq, ddq=ddq, jerk=jerk, velocity_bounds=dq)
            pieces = replace(motion, time=inner, q=q, derivatives=derivatives, cyclic=False)
            columns = self._limit_shares(pieces) + [each.shares(pieces)[..., None] for each in peaks]
            return np.maximum(np.concatenate([*columns, np.zeros((*times.shape, 1))], axis=-1), -1.0)  # −inf: no limit

        worst = np.full(len(motions), np.inf)
        for i, motion in enumerate(motions):
            with suppress(Infeasible):
                worst[i] = largest_between(partial(shares, motion), divide(self.times))
        return worst

    def discretisation_errors(self, motions: Motion) -> Float[np.ndarray, "points n_obj"]:
        """Return the errors of motions' objectives relative to the curve sampled 50 times finer.

        An error is infinite if a motion leaves its path between samples.
        """
        errors = np.full((len(motions), len(self.objectives)), np.inf)
        for i in range(len(motions)):  # each alone: the finer samples of a whole front take gigabytes
            motion = motions[i : i + 1]
            with suppress(Infeasible):
                finer = finer_motion(motion, SAMPLES.steps)
                errors[i] = [np.abs(each(finer) - each(motion)).item() for each in self.objectives]
        return errors

    def describe_between(self, motions: Motion) -> str:
        """Return in words the limit that motions (points, time, dof) violate most between samples, and a remedy.

        The text is "" if no limit is exceeded.
        """
        try:
            dense = finer_motion(motions)
        except Infeasible as error:
            return f"between samples: {error}; more samples help"
        worst = self.violations(dense).max(axis=1, initial=0.0)
        if not len(worst) or worst.max() <= LIMIT_TOLERANCE:
            return ""
        remedy = "more samples help" if self.differences == "spline" else 'differences="spline" or a margin= help'
        return f"between samples: {self.describe_violation(dense[int(worst.argmax())])}; {remedy}"

    def describe_violation(self, motion: Motion, numbers: Int[np.ndarray, " time"] | None = None) -> str:
        """Return in words the most violated limit, its time and its violation.

        motion: motion to describe
        numbers: indices of the samples in another task, if the samples are a part of that task

        The text is "" if all limits are satisfied. Limits with the same violation within 0.1 % are named too: if the
        motion has the smallest possible violation, these limits contradict each other.
        """
        motion = motion.instants
        violations = self.violations(motion)
        if not len(violations) or violations.max() <= 0:
            return ""
        worst = int(np.argmax(violations))
        amount = f"by {100 * violations[worst]:.3g} % of its range"
        name, where = self.limit_names[worst], self._where(worst, motion, numbers)
        if np.isnan(violations[worst]):
            message = f"{name} is nan{where}"
        elif name == "clearance":
            message = f"clearance is {self.min_clearance - motion.clearance.min():.3g} m too small{where}"
        else:
            (kind, joint), side = self.limit_joints[worst], "exceeded" if where else "violated"
            if kind == "position" and joint >= 0:
                instant = self.worst_instant(worst, motion)
                lower = np.broadcast_to(self.bounds_at(kind, motion.time)[..., joint, 0], len(motion.time))
                is_below = motion.q[instant, joint] < lower[instant]
                side = "below its lower limit" if is_below else "above its upper limit"
            message = f"{name} is {side} {amount}{where}"
        others = np.flatnonzero(violations >= (1 - 1e-3) * violations[worst]).tolist()
        tied = [f"{self.limit_names[i]}{self._where(i, motion, numbers)}" for i in others if i != worst]
        return message + (f"; equally violated: {' and '.join(tied)}" if tied else "")

    def worst_instant(self, limit: int, motion: Motion) -> int:
        """Return the instant of a limit's largest violation, −1 for a limit on the whole motion."""
        kind, joint = self.limit_joints[limit]
        if joint >= 0:
            violation = relative_violation(kind, self.bounds_at(kind, motion.time), motion)
            return int(np.argmax(violation[..., joint]))
        return int(motion.clearance.argmin()) if kind == "clearance" else -1

    def worst_sample(self, limit: int, motion: Motion) -> int:
        """Return the sample nearest to a limit's largest violation, −1 for the whole motion."""
        instant = self.worst_instant(limit, motion := motion.instants)
        return instant if instant < 0 else int(np.argmin(np.abs(self.times - motion.time[instant])))

    def _where(self, limit: int, motion: Motion, numbers: Int[np.ndarray, " time"] | None) -> str:
        """Return in words the time of a limit's largest violation. The text is "" for a limit on the whole motion."""
        instant = self.worst_instant(limit, motion)
        if instant < 0:
            return ""
        time = float(motion.time[instant])
        sample = int(np.argmin(np.abs(self.times - time)))
        number = np.arange(len(self.times)) if numbers is None else numbers
        where = f" at sample {number[sample]} ({time:.3g} s)"
        if not np.isclose(time, self.times[sample], rtol=0, atol=1e-9 * self.times[-1]):
            before = int(np.searchsorted(self.times, time)) - 1
            where = f" between samples {number[before]} and {number[before + 1]} ({time:.3g} s)"
        if self.limit_names[limit] != "clearance":
            return where
        return where + ", between " + closest_pair(self.obstacles, motion.links[instant], self.link_radius)


# Evaluation of motions: objectives, limits, and causes of failures.


def examine_functions(
    task: MotionTask, motions: Motion, F: Objectives | None = None, causes: np.ndarray | None = None
) -> None:
    """Warn of objectives that are constant or random.

    Raises the errors of ``require_values``.

    F, causes: results of ``evaluate_motions``, None if they are unknown
    """
    if F is None or causes is None:
        F, _, causes = evaluate_motions(task, motions)
    _require_value(causes)
    again = evaluate_motions(task, motions[:1])[0]
    signs = np.array([each.sign for each in task.objectives])
    warn_of_odd_objectives([each.name for each in task.objectives], F * signs, again * signs)


def require_values(task: MotionTask, motions: Motion) -> Objectives:
    """Return F of ``evaluate_motions``; raises EvaluationFailed if all motions failed."""
    F, _, causes = evaluate_motions(task, motions)
    _require_value(causes)
    return F


def _require_value(causes: np.ndarray) -> None:
    if all(causes):
        raise EvaluationFailed(f"every evaluation failed, the first with: {causes[0]}")


def evaluate_motions(
    task: MotionTask, motions: Motion, *, interruptible: bool = True
) -> tuple[Objectives, np.ndarray, np.ndarray]:
    """Return minimised objectives F, violations (points, limits), and causes of failure (points,).

    Values of failed evaluations are NaN. Raises Interrupted after a signal, if ``interruptible``.
    """
    if interruptible:
        check_interruption()
    causes = np.full(len(motions), "", dtype=object)
    columns = [_isolate([f"objective {o.name}"], o, motions, causes, interruptible) * o.sign for o in task.objectives]
    limits = _isolate(task.limit_names, task.violations, motions, causes, interruptible)
    return np.array(columns).reshape(len(columns), len(motions)).T, limits, causes


def _isolate(
    names: Sequence[str],
    function: Callable[[Motion], np.ndarray],
    motions: Motion,
    causes: np.ndarray,
    interruptible: bool,
) -> np.ndarray:
    """Return the values (points, names) of users' functions; NaN for each motion at which they fail."""
    if interruptible:
        check_interruption()
    try:
        values = function(motions)
    except EvaluationFailed as error:
        if len(motions) == 1:
            causes[0] = causes[0] or str(error)
            return np.full((1, len(names)), np.nan)
        single = [slice(i, i + 1) for i in range(len(motions))]
        return np.concatenate([_isolate(names, function, motions[i], causes[i], interruptible) for i in single])
    values = values.reshape(len(values), -1)
    for i, row in enumerate(values):
        failed = np.flatnonzero(~np.isfinite(row))
        if len(failed):
            causes[i] = causes[i] or f"{names[failed[0]]} is {row[failed[0]]}"
    return values

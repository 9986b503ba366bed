"""What everyone solves: an arm, its tasks, what a motion is worth, what it may not exceed, how it starts and ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from paretoik.arrays import JointPaths, Times
from paretoik.errors import InvalidInput
from paretoik.robot.arm import Arm
from paretoik.robot.pose import finite_array
from paretoik.task.differences import Differences, quadrature
from paretoik.task.limits import Bounds, Constraint, Limits, excess
from paretoik.task.motion import Motion
from paretoik.task.objectives import Objective
from paretoik.task.obstacles import Obstacle
from paretoik.task.path import Path
from paretoik.task.retraction import task_errors
from paretoik.task.task import Task

START_TOLERANCE = 1e-6  # m and rad: a start this near the path is moved onto it
TIED = 1e-3  # share of the worst violation by which others are as bad


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionTask:
    """One motion problem, checked; made with ``motion_task``.

    ``start`` is None (free) or joint positions (dof,); ``bounds`` maps limit kinds to (1 or time, dof, 2) arrays;
    ``arm`` carries the position limits that hold, the widest where they vary along the path.
    """

    arm: Arm
    tasks: tuple[Task, ...]
    objectives: tuple[Objective, ...]
    constraints: tuple[Constraint, ...]
    bounds: dict[str, Bounds]
    obstacles: tuple[Obstacle, ...]
    link_radius: float
    least_clearance: float
    start: Float[np.ndarray, " dof"] | None
    stops: bool
    cyclic: bool
    differences: Differences

    @property
    def times(self) -> Times:
        """Sample times (time,) [s]."""
        return self.tasks[0].path.times

    @property
    def weights(self) -> Times:
        """Weights (time,) [s] of integrals over the samples."""
        return quadrature(self.times, self.differences)

    @property
    def rows(self) -> int:
        """Number of task equations a sample."""
        return sum(task.rows for task in self.tasks)

    @property
    def redundancy(self) -> int:
        """Number of joints beyond the task equations."""
        return self.arm.dof - self.rows

    @cached_property
    def targets(self) -> Float[np.ndarray, "time numbers"]:
        """Task targets of every sample, as ``Task.targets`` gives them."""
        return np.concatenate([task.targets(self.times) for task in self.tasks], axis=1)

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
        )

    def subsampled(self, samples: int) -> MotionTask:
        """Return the same task at so many of its samples, both ends among them; raises InvalidInput for too many."""
        return self._on([task.path.subsampled(samples) for task in self.tasks])

    def until(self, samples: int) -> MotionTask:
        """Return the first so many samples of the task, which is then not cyclic; raises InvalidInput for too many."""
        if samples == len(self.times):
            return self
        return replace(self._on([task.path.until(samples) for task in self.tasks]), cyclic=False)

    def _on(self, paths: Sequence[Path]) -> MotionTask:
        tasks = tuple(replace(task, path=path) for task, path in zip(self.tasks, paths, strict=True))
        kept = np.searchsorted(self.times, paths[0].times)
        bounds = {kind: limits if len(limits) == 1 else limits[kept] for kind, limits in self.bounds.items()}
        return replace(self, tasks=tasks, bounds=bounds)

    def resampled(self, samples: int) -> MotionTask:
        """Return the same task at so many samples, evenly spaced; limits that vary are interpolated linearly."""
        tasks = tuple(replace(task, path=task.path.resampled(samples)) for task in self.tasks)
        times = tasks[0].path.times
        bounds = {}
        for kind, limits in self.bounds.items():
            flat = limits.reshape(len(limits), -1)
            columns = [np.interp(times, self.times, column) for column in flat.T] if len(flat) > 1 else None
            bounds[kind] = limits if columns is None else np.stack(columns, axis=1).reshape(samples, *limits.shape[1:])
        return replace(self, tasks=tasks, bounds=bounds)

    @cached_property
    def limit_names(self) -> tuple[str, ...]:
        """A name for each column of ``violations``."""
        joints = tuple(
            f"{kind} of {joint}"
            for kind, bounds in self.bounds.items()
            for joint, limited in zip(self.arm.joint_names, self._limited(bounds), strict=True)
            if limited
        )
        return joints + (("clearance",) if self.obstacles else ()) + tuple(c.name for c in self.constraints)

    def violations(self, motion: Motion) -> Float[np.ndarray, "*batch limits"]:
        """Return the worst violation of every limit as a share of its range; not positive where it holds."""
        found = [
            excess(kind, bounds, motion).max(axis=-2)[..., self._limited(bounds)]
            for kind, bounds in self.bounds.items()
        ]
        batch = motion.q.shape[:-2]
        if self.obstacles:
            least = motion.clearance.min(axis=-1)
            found.append(((self.least_clearance - least) / max(self.least_clearance, 0.01))[..., None])
        found += [constraint.violation(motion)[..., None] for constraint in self.constraints]
        return np.concatenate(found, axis=-1) if found else np.zeros((*batch, 0))

    def binding(self, motion: Motion) -> str:
        """Return in words which limit a single motion violates most, where and by how much; "" where all hold.

        Limits that are violated as much are named too: of a motion that violates all as little as can be, those that
        stand against each other.
        """
        violations = self.violations(motion)
        if not len(violations) or violations.max() <= 0:
            return ""
        worst = int(np.argmax(violations))
        share = f"by {100 * violations[worst]:.3g} % of its range"
        name, place = self.limit_names[worst], self._place(worst, motion)
        if name == "clearance":
            said = f"clearance is {self.least_clearance - motion.clearance.min():.3g} m short{place}"
        else:
            said = f"{name} is {'exceeded' if place else 'violated'} {share}{place}"
        others = np.flatnonzero(violations >= (1 - TIED) * violations[worst]).tolist()
        tied = [f"{self.limit_names[i]}{self._place(i, motion)}" for i in others if i != worst]
        return said + (f"; so is {' and '.join(tied)}" if tied else "")

    def _place(self, limit: int, motion: Motion) -> str:
        """Return in words at which sample a limit is violated most, "" where it is none of samples."""
        name = self.limit_names[limit]
        kind, _, joint = name.partition(" of ")
        if name == "clearance":
            sample = int(motion.clearance.argmin())
        elif kind in self.bounds:
            over = excess(kind, self.bounds[kind], motion)[..., self.arm.joint_names.index(joint)]
            sample = int(np.argmax(over))
        else:
            return ""
        return f" at sample {sample} ({self.times[sample]:.3g} s)"

    def _limited(self, bounds: Bounds) -> np.ndarray:
        return np.isfinite(bounds).any(axis=(0, 2))


def motion_task(
    arm: Arm,
    tasks: Path | Task | Sequence[Path | Task],
    *,
    objectives: Sequence[Objective],
    limits: Limits | None = None,
    constraints: Sequence[Constraint] = (),
    obstacles: Sequence[Obstacle] = (),
    link_radius: float = 0.0,
    start: object = "free",
    end_velocity: float | None = None,
    cyclic: bool = False,
    differences: Differences = "backward",
    redundant: bool = True,
) -> MotionTask:
    """Check everything that a motion problem is made of and return it.

    ``redundant`` refuses tasks that leave no joint over. Raises InvalidInput, naming the thing, for each part that
    cannot be used.
    """
    if not isinstance(arm, Arm):
        raise InvalidInput(f"arm: an Arm wanted, such as tringali_3r() or Arm.from_urdf(...), got {arm!r}")
    settled = tuple(_task(given).settled(arm) for given in (tasks if isinstance(tasks, Sequence) else [tasks]))
    _check_tasks(arm, settled, redundant)
    _check_decorated("objective", objectives, Objective)
    _check_decorated("constraint", constraints, Constraint)
    if not objectives:
        raise InvalidInput("objectives: wants at least one, got none")
    if limits is not None and not isinstance(limits, Limits):
        raise InvalidInput(f"limits: Limits(...) wanted, got {limits!r}")
    if not isinstance(obstacles, Sequence) or not all(isinstance(one, Obstacle) for one in obstacles):
        raise InvalidInput(f"obstacles: a list of obstacles wanted, got {obstacles!r}")
    if not finite_array("link_radius", link_radius, ()) >= 0:
        raise InvalidInput(f"link_radius: 0 m or more wanted, got {link_radius}")
    path = settled[0].path
    if cyclic and not all(task.path.closed for task in settled):
        raise InvalidInput("cyclic=True wants a closed path, but the path does not end where it starts")
    if end_velocity is not None and (end_velocity != 0 or cyclic):
        raise InvalidInput(f"end_velocity must be None (free) or 0 on an open motion, got {end_velocity!r}")
    if end_velocity is not None:
        _check_rest(settled)
    bounds = (limits or Limits()).settled(arm, path.samples)
    allowed = bounds.get("position", np.tile([-np.inf, np.inf], (1, arm.dof, 1)))
    widest = np.stack([allowed[..., 0].min(axis=0), allowed[..., 1].max(axis=0)], axis=-1)
    arm = replace(arm, position_limits=widest)
    found = MotionTask(
        arm=arm,
        tasks=settled,
        objectives=tuple(objectives),
        constraints=tuple(constraints),
        bounds=bounds,
        obstacles=tuple(obstacles),
        link_radius=link_radius,
        least_clearance=(limits or Limits()).clearance,
        start=None if isinstance(start, str) and start == "free" else _given_start(arm, start),
        stops=end_velocity is not None,
        cyclic=cyclic,
        differences=differences,
    )
    return found if found.start is None else _started(found)


def _task(given: object) -> Task:
    if not isinstance(given, Path | Task):
        raise InvalidInput(f"path wants a Path, a Task or several of them, got {given!r}")
    return Task(given) if isinstance(given, Path) else given


def _check_tasks(arm: Arm, tasks: tuple[Task, ...], redundant: bool) -> None:
    if not tasks:
        raise InvalidInput("wants at least one path or task, got none")
    times = tasks[0].path.times
    for i, task in enumerate(tasks[1:], start=2):
        if not np.array_equal(task.path.times, times):
            raise InvalidInput(f"task {i}: must be sampled at the same times as task 1")
    rows = sum(task.rows for task in tasks)
    if rows > arm.dof - redundant:
        wish = "is not redundant for this task" if redundant else "has too few joints for this task"
        raise InvalidInput(f"{arm.name} {wish}: {arm.dof} joints for {rows} equations; ask for fewer axes")


def _check_decorated(kind: str, given: Sequence[Objective] | Sequence[Constraint], wanted: type) -> None:
    if not isinstance(given, Sequence):
        raise InvalidInput(f"{kind}s: wants a list, got {given!r}")
    for member in given:
        if not isinstance(member, wanted):
            raise InvalidInput(f"{kind}s: wants functions decorated with @{kind}, got {member!r}")
    names = [member.name for member in given]
    if len(set(names)) != len(names):
        raise InvalidInput(f"{kind}s: names must differ, got {', '.join(names)}")


def _check_rest(tasks: tuple[Task, ...]) -> None:
    for task in tasks:
        path = task.path
        instants = np.array([0.9999, 1.0]) * path.duration
        last = np.linalg.norm(np.diff(path.at(instants)[0], axis=0)) / np.diff(instants)[0]
        mean = np.linalg.norm(np.diff(path.positions, axis=0), axis=1).sum() / path.duration
        if last > 0.01 * mean:
            raise InvalidInput(f"end_velocity=0 wants a path that comes to rest, but it ends at {last:.3g} m/s")


def _given_start(arm: Arm, start: object) -> np.ndarray:
    try:
        q = np.array(start, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInput(f"start must be 'free' or {arm.dof} joint positions, got {start!r}") from None
    if q.shape != (arm.dof,) or not np.all(np.isfinite(q)):
        raise InvalidInput(f"start must be 'free' or {arm.dof} finite joint positions, got {start!r}")
    return q


def _started(found: MotionTask) -> MotionTask:
    assert found.start is not None
    error, _ = task_errors(found.arm, found.tasks, found.start[None], found.targets[:1])
    distance = float(np.abs(error).max())
    if distance > START_TOLERANCE:
        raise InvalidInput(
            f"start is {distance:.3g} m (or rad) off the path's first sample; wants at most {START_TOLERANCE}"
        )
    if "position" in found.bounds:
        lower, upper = found.bounds["position"][0].T
        outside = (found.start < lower) | (found.start > upper)
        if outside.any():
            j = int(np.argmax(outside))
            raise InvalidInput(
                f"start: {found.arm.joint_names[j]} at {found.start[j]:.6g} is outside its limits {lower[j]:.6g} to "
                f"{upper[j]:.6g}"
            )
    return found

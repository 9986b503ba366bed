"""Parts of a recording's messages as plain data: workcells, points, motions, scenes and ends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Int, Shaped

from paretoik.arrays import Times, Values
from paretoik.capability.directional import PerformancePolygon
from paretoik.capability.joint_capability import Quantity, joint_speeds, torque_capacity
from paretoik.collision.obstacles import LinkRadius, Obstacle, clearance
from paretoik.formulations.protocol import task_of
from paretoik.front.choice import Choice
from paretoik.front.front import Front
from paretoik.front.preferences.knee_and_compromise import best_rows
from paretoik.resolution.protocol import ResolvedMotion
from paretoik.review.palette import DRAWING, even_rows
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import gravity_torques
from paretoik.robot.kinematics import link_nodes
from paretoik.task.differences import Differences
from paretoik.task.limits import JOINT_UNITS, LIMITED, Bounds, Limits, is_sliding, joint_units
from paretoik.task.motion import Motion

# The workcell: everything drawn around a problem's motions, as plain data for another process.


@dataclass(frozen=True, kw_only=True, eq=False)
class Workcell:
    """An arm and what is around it.

    paths: paths that frames of the arm must follow, each (time, 3) [m]
    places: other important places (3,) [m], by name
    directions: unit vectors (directions, 3) that begin at the first place
    link_radius: radius of every link [m], or a tuple of one per link
    bounds: limits (1 or time, dof, 2) by kind
    times: times of limits that vary [s]
    differences, cyclic, ends_at_rest: as in ``Motion``
    """

    arm: Arm
    paths: tuple[Float[np.ndarray, "time 3"], ...] = ()
    places: Mapping[str, Float[np.ndarray, " 3"]] = field(default_factory=dict)
    directions: Float[np.ndarray, "directions 3"] = field(default_factory=lambda: np.zeros((0, 3)))
    obstacles: tuple[Obstacle, ...] = ()
    link_radius: LinkRadius = 0.0
    bounds: Mapping[str, Bounds] = field(default_factory=dict)
    times: Times = field(default_factory=lambda: np.zeros(0))
    differences: Differences = "backward"
    cyclic: bool = False
    ends_at_rest: bool = False


def workcell_of(problem: Any) -> Workcell | None:
    """Return the workcell of a formulation; None if the problem has no arm."""
    task = task_of(problem)
    if task is not None:
        paths = tuple(in_space(each.path.positions) for each in task.tasks)
        same = ("arm", "bounds", "times", "differences", "cyclic", "ends_at_rest")
        kept = {name: getattr(task, name) for name in same}
        return Workcell(paths=paths, obstacles=tuple(task.obstacles), link_radius=task.link_radius, **kept)
    arm = getattr(problem, "arm", None)
    if not isinstance(arm, Arm):
        return None
    places = {name: np.asarray(getattr(problem, name, ())) for name in ("position", "start", "target")}
    return Workcell(
        arm=arm,
        places={name: in_space(place) for name, place in places.items() if place.shape in ((2,), (3,))},
        directions=in_space(np.asarray(getattr(problem, "directions", np.zeros((0, 3))))),
        bounds=Limits(velocity=np.inf, torque=np.inf).bounds(arm, 1),
    )


def in_space(points: np.ndarray) -> np.ndarray:
    """Return points (..., 2 or 3) with all three coordinates."""
    padding = [(0, 0)] * (points.ndim - 1) + [(0, 3 - points.shape[-1])]
    return np.pad(np.asarray(points, dtype=float), padding)


# The recording of a tool path: the tool's positions over time, and its target.


@dataclass(frozen=True, kw_only=True, eq=False)
class PathScene:
    """The scene of a tool path from ``start`` to ``target`` (task,) [m]; ``title``: name of the path."""

    title: str
    start: Float[np.ndarray, " task"]
    target: Float[np.ndarray, " task"]


@dataclass(frozen=True, kw_only=True, eq=False)
class PathEnd:
    """Positions of the ``tool`` [m] at ``times`` [s], its ``reference``, if any, and its ``target``."""

    times: Times
    tool: Float[np.ndarray, "n task"]
    reference: Float[np.ndarray, "n task"] | None
    target: Float[np.ndarray, " task"]
    provenance: Mapping[str, Any]

    @property
    def middles(self) -> Times:
        """Midpoints between the times of samples [s]."""
        return (self.times[1:] + self.times[:-1]) / 2

    @property
    def speed(self) -> Float[np.ndarray, " _"]:
        """Mean speed of the tool between samples [m/s]; 0 if the tool does not move."""
        way, steps = np.linalg.norm(np.diff(self.tool, axis=0), axis=1), np.diff(self.times)
        return np.divide(way, steps, out=np.zeros_like(way), where=steps > 0)

    @property
    def distance(self) -> Float[np.ndarray, " n"]:
        """Distance of the tool from its target [m]."""
        return np.asarray(np.linalg.norm(self.tool - self.target, axis=1))


# The recording of directional maxima: the polygon, and how each corner is reached.


@dataclass(frozen=True, kw_only=True, eq=False)
class MaximaScene:
    """The scene of directional maxima: the workcell of their postures, and the maximised quantity."""

    workcell: Workcell
    quantity: Quantity

    @property
    def unit(self) -> str:
        """Unit of the maxima."""
        return "m/s" if self.quantity == "velocity" else "N"

    @property
    def word(self) -> str:
        """The name of the maximised quantity."""
        return "speed" if self.quantity == "velocity" else "force"


@dataclass(frozen=True, kw_only=True, eq=False)
class MaximaEnd:
    """The result of directional maxima: a ``polygon`` without its actuation, which may be the user's own.

    lower, upper: joint limits (directions, dof) due to the motors in each posture, as speeds [rad/s, m/s] or torques
        [N m, N]
    provenance: provenance of the run
    """

    polygon: PerformancePolygon
    lower: Float[np.ndarray, "directions dof"]
    upper: Float[np.ndarray, "directions dof"]
    provenance: Mapping[str, Any]


def maxima_end(polygon: PerformancePolygon, provenance: Mapping[str, Any]) -> MaximaEnd:
    """Return the recorded form of a polygon."""
    if polygon.quantity == "velocity":
        speeds = joint_speeds(polygon.actuation, polygon.q, gravity_torques(polygon.arm, polygon.q))
        lower, upper = speeds.low, speeds.high
    else:
        upper, _ = torque_capacity(polygon.actuation, polygon.q)
        lower = -upper
    object.__setattr__(recorded := copy(polygon), "actuation", None)
    return MaximaEnd(polygon=recorded, lower=lower, upper=upper, provenance=provenance)


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedMotion:
    """A motion as plain arrays: joint positions ``q`` (time, dof) at ``time`` (time,) [s].

    curves: joint quantities (time, dof) by kind of limit, units from rad, m, s, N m, N and W; None: computed from ``q``
    """

    time: Times
    q: Float[np.ndarray, "time dof"]
    curves: Mapping[str, Float[np.ndarray, "time dof"]] | None = None

    @property
    def is_standing(self) -> bool:
        """Whether the arm stands still."""
        return not np.ptp(self.q, axis=0).any()


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedPoint:
    """A point that is drawn individually, such as the chosen one or the best of an objective.

    axis: objective in which the point is best; None for other points
    motion: None if the point has no motion, or if its genes were not decoded, to save time
    """

    id: int
    objectives: Values
    axis: int | None = None
    motion: RecordedMotion | None = None


def record_motion(motion: Any, *, curves: bool, samples: int | None = None) -> RecordedMotion | None:
    """Return a single motion as plain arrays; None if it is not a motion of an arm.

    curves: whether to add the curves of its joints
    samples: largest number of samples, taken evenly spaced
    """
    if not isinstance(motion, Motion):
        return None
    count = len(motion.time)
    rows = even_rows(count, count if samples is None else samples)
    kinds = {kind: np.array(getattr(motion, name)[rows]) for kind, name in LIMITED.items()} if curves else None
    return RecordedMotion(time=np.array(motion.time[rows]), q=np.array(motion.q[rows]), curves=kinds)


def joint_curves(cell: Workcell, motion: RecordedMotion) -> Mapping[str, np.ndarray]:
    """Return the joint quantities (time, dof) of a motion by kind of limit."""
    if motion.curves is not None:
        return motion.curves
    kept: Any = {name: getattr(cell, name) for name in ("arm", "differences", "cyclic", "ends_at_rest")}
    full = Motion(time=motion.time, q=motion.q, **kept)
    return {kind: np.asarray(getattr(full, name)) for kind, name in LIMITED.items()}


def end_points(front: Front, choice: Choice | None) -> tuple[RecordedPoint, ...]:
    """Return the best points of a front's objectives and the choice, if any, with their motions."""
    if not len(front):
        return ()
    rows = best_rows(front.minimised, front.ids) if len(front.names) > 1 else []
    ends = tuple(front_point(front, row, axis=axis) for axis, row in enumerate(rows))
    return ends if choice is None else (*ends, chosen_point(choice))


def front_point(front: Front, row: int, *, axis: int | None = None) -> RecordedPoint:
    """Return a row of a front as a point; ``axis``: objective in which it is best, if any."""
    motion = None if front.motions is None else record_motion(front.motions[row], curves=axis is None)
    return RecordedPoint(id=int(front.ids[row]), objectives=front.objectives[row], axis=axis, motion=motion)


def chosen_point(choice: Choice) -> RecordedPoint:
    """Return a choice as a point."""
    return RecordedPoint(id=choice.id, objectives=choice.objectives, motion=record_motion(choice.motion, curves=True))


@dataclass(frozen=True, kw_only=True, eq=False)
class LeastViolating:
    """The individual or motion that breaks a problem's constraints least, if none satisfies them all.

    broken: broken constraints, with amounts
    reason: at the end of a run, why it has no result
    point: the individual or motion itself at the end of a run; None if there is no motion
    """

    broken: tuple[str, ...]
    reason: str = ""
    point: RecordedPoint | None = None


# The recording of a plan: its levels, and its optima.


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedMotions:
    """The motions of a level, at ``time`` [s]: its starts, their results, and the distinct optima.

    ``optimum``: index of the optimum that each start led to, −1 if none.
    """

    time: Times
    starts: Float[np.ndarray, "starts time dof"]
    ends: Float[np.ndarray, "starts time dof"]
    optima: Float[np.ndarray, "optima time dof"]
    optimum: Int[np.ndarray, " starts"]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedLevel:
    """A finished level of a plan: the objective, in its own sign, of its starts and of its optima.

    number: number of the level, from 0
    samples: number of samples of the level's motions
    starts: values of the starts
    ends: values of the starts' results, NaN if a result is not an optimum
    optima: values of the optima, best first; of the least-violating motions if none satisfies all limits
    least_violating: what the first of the least-violating motions breaks; None if a motion satisfies all limits
    """

    number: int
    samples: int
    starts: Float[np.ndarray, " starts"]
    ends: Float[np.ndarray, " starts"]
    optima: Float[np.ndarray, " optima"]
    motions: PlannedMotions
    least_violating: LeastViolating | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedScene:
    """The scene of a plan: the objective's name, unit and sense, and the workcell."""

    name: str
    unit: str
    maximised: bool
    workcell: Workcell
    timeline: str = "level"


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedOptimum:
    """An optimum of a plan: its ``point`` (the id is its index), branch, status and violation."""

    point: RecordedPoint
    branch: str
    status: str
    violation_between: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanEnd:
    """The optima of a plan, best first, and the ``provenance`` of its run."""

    optima: Sequence[PlannedOptimum] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    least_violating: LeastViolating | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class ResolvedScene:
    """The scene of resolved motions: the workcell, and the names of the method and its criteria.

    tolerance: error at which the path counts as lost, in ``error_unit``
    min_clearance: required clearance of links [m]
    """

    workcell: Workcell
    method: str
    criteria: tuple[str, ...]
    tolerance: float
    error_unit: str
    min_clearance: float

    @property
    def speed_unit(self) -> str:
        """Unit of joint speeds; both units if an arm has both kinds of joints."""
        return joint_units(self.workcell.arm, JOINT_UNITS["velocity"])

    @property
    def damping_unit(self) -> str:
        """Unit of the damping and of the Jacobian."""
        turns = not is_sliding(self.workcell.arm).any()
        return "m/rad" if turns and self.error_unit == "m" else "units of the Jacobian"


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedTraces:
    """A resolved motion, and the traces of its method at samples and over the steps between them.

    point: the motion as a point, whose id is its place in the batch
    error: largest task error at each sample
    clearance: clearance at each sample [m]; None if there are no obstacles
    speed: norm of the commanded joint velocities
    damping: damping of the step
    repulsion: norm of the joint velocities away from limits
    criteria: norms of the joint velocities due to each criterion
    status: status of the step in one word
    """

    name: str
    point: RecordedPoint
    error: Float[np.ndarray, " time"]
    clearance: Float[np.ndarray, " time"] | None
    speed: Float[np.ndarray, " steps"]
    damping: Float[np.ndarray, " steps"]
    repulsion: Float[np.ndarray, " steps"]
    criteria: Float[np.ndarray, "steps criteria"]
    status: Shaped[np.ndarray, " steps"]

    @property
    def time(self) -> Times:
        """Times of the samples [s]."""
        assert self.point.motion is not None
        return self.point.motion.time


@dataclass(frozen=True, kw_only=True, eq=False)
class ResolutionEnd:
    """Some or all of ``count`` resolved motions, at least one, and the ``provenance`` of their run."""

    motions: Sequence[RecordedTraces]
    count: int
    provenance: Mapping[str, Any]


def record_traces(motion: ResolvedMotion) -> tuple[list[RecordedTraces], int]:
    """Return the motions of a batch, or evenly spread ones of many, and the size of the batch."""
    batch, recorded = list(np.ndindex(motion.q.shape[:-2])), list[RecordedTraces]()
    for place in even_rows(len(batch), DRAWING.walk).tolist():
        index = batch[place]
        one = motion[index] if index else motion
        traces, obstacles = one.traces, one.obstacles
        distance = clearance(obstacles, link_nodes(one.arm, one.q), one.link_radius) if obstacles else None
        recorded.append(
            RecordedTraces(
                name=f"motion {', '.join(map(str, index))}" if index else "the motion",
                point=RecordedPoint(id=place, objectives=np.zeros(0), motion=record_motion(one, curves=True)),
                error=np.abs(traces.errors).max(axis=-1),
                clearance=None if distance is None else np.asarray(distance),
                speed=np.linalg.norm(traces.velocities, axis=-1),
                damping=traces.damping,
                repulsion=np.linalg.norm(traces.repulsion, axis=-1),
                criteria=np.linalg.norm(traces.projected, axis=-1),
                status=traces.status,
            )
        )
    return recorded, len(batch)

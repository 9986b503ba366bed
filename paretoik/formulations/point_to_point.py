"""Motions from point to point without a given path: time against energy.

An individual is a spline of joint positions and of slider positions along the links. Its ends are retracted to the
start and the target of the tool. Path and posture are searched together. The least time of the motion and the work of
its motors follow in closed form.

Source: Kim, Choi & Jang 2021, section 3, which minimises only time; weighing it against energy is new.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Genes, JointPaths
from paretoik.capability.actuation import Actuation, DistributedActuation, check_actuation
from paretoik.capability.joint_capability import joint_speeds, overload_error
from paretoik.capability.point_to_point_program import PointToPointProgram, Timing, minimum_timing, require_weight
from paretoik.capability.postures import restrict_to_rods, sample_holdable_postures, stationary_task
from paretoik.errors import Infeasible, InvalidInput, OutOfReach
from paretoik.formulations.dense_formulation import (
    DenseFormulation,
    WholeProgram,
    front_sliders,
    function_task,
    read_times,
    slider_shares,
)
from paretoik.formulations.encoding import clamped_spline
from paretoik.formulations.formulation import of_genes
from paretoik.inputs import check_flag, check_size, finite_array
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import gravity_torques
from paretoik.task.limits import LIMIT_TOLERANCE, Constraint
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask, evaluate_motions
from paretoik.task.objectives import Objective, joint_travel
from paretoik.task.path import line, waypoints
from paretoik.task.random_starts import rollout_starts, travelling_starts
from paretoik.task.retraction import ON_PATH_TOLERANCE, retract, task_errors
from paretoik.task.validation import motion_task

# Initial paths: splines in different postures, straight or curved.


@dataclass(frozen=True, kw_only=True)
class InitialPathOptions:
    """Settings of the search for initial paths."""

    rollouts: int = 256  # number of sampled postures at each end, and of sampled motions of each kind along a line
    bows: tuple[float, ...] = (0.5, 1.0, 2.0)  # sideways shifts of a line's midpoint, as shares of its length
    fixed_sliders: int = 5  # number of positions at which fixed sliders are tried
    work_unit: float = 1e-6  # J: least unit of work; the work itself is 0 without gravity
    distance: float = 0.2  # rad or m: least distance between the coefficients of two paths


PATHS = InitialPathOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class InitialPaths:
    """Splines of joint positions, and of sliders as shares of their range."""

    q: Float[np.ndarray, "bases coefficients dof"]  # rad, m: coefficients of joint positions
    shares: Float[np.ndarray, "bases coefficients dof"]  # coefficients of sliders, as shares of their range
    spline: Float[np.ndarray, "time coefficients"]  # matrix from coefficients to samples
    across: Float[np.ndarray, "bases 2 dof rows"]  # directions in which either end is retracted
    pace: float  # s: mean interval of the quickest path
    work_unit: float  # J: mean work of a motor in that path

    @property
    def size(self) -> int:
        """Number of coefficients of all joints."""
        return int(np.prod(self.q.shape[1:]))

    def finer(self, times: int) -> Float[np.ndarray, "fine coefficients"]:
        """Return the spline's matrix with each interval divided into ``times`` parts."""
        samples = times * (len(self.spline) - 1) + 1
        return clamped_spline(np.linspace(0.0, 1.0, samples), self.spline.shape[1])


def range_excess(
    arm: Arm, actuation: Actuation, q: JointPaths, front: JointPaths
) -> tuple[Float[np.ndarray, " points"], Float[np.ndarray, " points"]]:
    """Return the largest excess of joints [rad, m] and sliders [shares of the rod] over their bounds."""
    lower, upper = arm.position_limits.T
    joints = np.maximum(np.maximum(q - upper, lower - q).max(axis=(1, 2)), -1.0)
    if not isinstance(actuation, DistributedActuation):
        return joints, np.full(len(q), -1.0)
    back, angle = actuation.gears(q, front)[0], actuation.angles(q)
    excess = list[np.ndarray]()
    for place, (low, high) in ((front, actuation.front_bounds.T), (back, actuation.back_bounds.T)):
        excess += [(place - high) / actuation.rod, (low - place) / actuation.rod]
    excess.append(np.sin(actuation.least_angle) - np.sin(angle))
    return joints, np.max(excess, axis=(0, 2, 3))


def find_initial_paths(
    arm: Arm,
    actuation: Actuation,
    start: Float[np.ndarray, " task"],
    target: Float[np.ndarray, " task"],
    *,
    samples: int,
    coefficients: int,
    bases: int,
    seed: int,
) -> InitialPaths:
    """Return at most ``bases`` paths that motors can hold, the quickest first.

    Paths are straight, or curved sideways if a straight one cannot be followed. Raises OutOfReach and Infeasible.
    """
    restricted, rng = restrict_to_rods(arm, actuation), np.random.default_rng(seed)
    basis = clamped_spline(np.linspace(0.0, 1.0, samples), coefficients)
    task, q_samples = _follow_lines(restricted, actuation, start, target, samples, rng)
    splines = _fit_spline(basis, q_samples)
    shares = _initial_sliders(actuation, arm, basis, splines)
    splines = np.repeat(splines, len(shares) // len(splines), axis=0)
    q, front = basis @ splines, front_sliders(actuation, basis @ shares)
    with np.errstate(invalid="ignore"):
        timing, excess = minimum_timing(arm, actuation, q, front), range_excess(arm, actuation, q, front)
    worst = np.nan_to_num(np.maximum(np.maximum(excess[0], timing.overload), excess[1]), nan=1e3)
    feasible = np.flatnonzero((worst <= 0) & np.isfinite(timing.duration))
    if not len(feasible):  # a search may still find feasible sliders: keep the least-violating paths
        holdable = ~np.isnan(joint_speeds(actuation, q, gravity_torques(arm, q)).high).any(axis=(1, 2))
        if not holdable.any():
            index = int(np.argmin(worst))
            load = gravity_torques(arm, q[index])
            sample = int(np.isnan(joint_speeds(actuation, q[index], load).high).any(axis=1).argmax())
            raise overload_error(actuation, arm, q[index, sample], load[sample])
        feasible = np.flatnonzero(holdable)[np.argsort(worst[holdable])][:bases]
    order = feasible[np.argsort(np.nan_to_num(timing.duration[feasible], nan=np.inf), kind="stable")]
    rows = [int(order[0])]  # the quickest ones that are far enough from each other
    for row in order[1:]:
        if len(rows) < bases and np.abs(splines[rows] - splines[row]).max(axis=(1, 2)).min() > PATHS.distance:
            rows.append(int(row))
    # At either end the task changes along the rows of its Jacobian.
    jacobian = task_errors(task.arm, task.tasks, splines[:, [0, -1]], task.targets[[0, -1]])[1]
    return InitialPaths(
        q=splines[rows],
        shares=shares[rows],
        spline=basis,
        across=np.linalg.qr(jacobian.swapaxes(-1, -2))[0][rows],
        pace=float(np.nan_to_num(timing.duration[rows[0]], nan=1.0)) / (samples - 1),
        work_unit=max(float(np.nan_to_num(timing.work[rows[0]], nan=1.0).mean()), PATHS.work_unit),
    )


def _follow_lines(
    arm: Arm, actuation: Actuation, start: np.ndarray, target: np.ndarray, samples: int, rng: np.random.Generator
) -> tuple[MotionTask, Float[np.ndarray, "found time dof"]]:
    """Return the task of the first line that can be followed, straight before curved, and motions along it."""
    lines = [line(start, target, duration=1.0, samples=samples, timing="uniform")]
    sideways = np.linalg.svd((target - start)[None])[2][1:] * np.linalg.norm(target - start)
    for bow in PATHS.bows:
        middles = [(start + target) / 2 + bow * side for side in (*sideways, *-sideways)]
        lines += [
            waypoints(np.stack([start, middle, target]), duration=1.0, samples=samples, timing="uniform")
            for middle in middles
        ]
    for name, place in (("start", start), ("target", target)):
        try:
            sample_holdable_postures(arm, actuation, place, PATHS.rollouts, rng)
        except (OutOfReach, Infeasible) as fault:
            fault.args = (f"{name}: {fault}",)
            raise
    faults = list[OutOfReach | Infeasible]()
    for path in lines:
        task = motion_task(arm, path, objectives=[joint_travel], differences="backward")
        try:
            return task, np.concatenate(
                [rollout_starts(task, PATHS.rollouts, rng), travelling_starts(task, PATHS.rollouts, rng)]
            )
        except (OutOfReach, Infeasible) as fault:
            faults.append(fault)
    faults[0].args = (f"start to target: no path was found, straight or curved; straight: {faults[0]}",)
    raise faults[0]


def _initial_sliders(actuation: Actuation, arm: Arm, basis: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Return slider coefficients to try, grouped by path.

    Candidates are the slider positions at which joints are fastest, which may need long travel; their means; midpoints
    of the feasible range; and fixed positions.
    """
    if not isinstance(actuation, DistributedActuation):
        return np.zeros_like(coefficients)
    q = basis @ coefficients
    speeds = joint_speeds(actuation, q, gravity_torques(arm, q))
    fastest = np.where(np.isnan(speeds.high), np.nan, slider_shares(actuation, speeds.front_high))
    best = np.clip(_fit_spline(basis, np.nan_to_num(fastest, nan=0.5)), 0.0, 1.0)
    fixed = np.linspace(0.0, 1.0, PATHS.fixed_sliders)[:, None, None] * np.ones_like(best[:1])
    steady = np.repeat(best.mean(axis=1, keepdims=True), best.shape[1], axis=1)
    # midpoints of the front sliders' ranges in which back sliders are within bounds
    places, fits = np.linspace(0.0, 1.0, 4 * PATHS.fixed_sliders + 1), list[np.ndarray]()
    for share in places:
        back = actuation.gears(q, front_sliders(actuation, np.full(q.shape, share)))[0]
        fits.append((back >= actuation.back_bounds[:, 0]) & (back <= actuation.back_bounds[:, 1]))
    middles = np.tensordot(places, np.array(fits, dtype=float), axes=1) / np.maximum(np.sum(fits, axis=0), 1)
    middle = np.clip(_fit_spline(basis, middles), 0.0, 1.0)
    candidates = [best, steady, middle, *(np.repeat(one[None], len(best), axis=0) for one in fixed)]
    return np.stack(candidates, axis=1).reshape(-1, *best.shape[1:])


def _fit_spline(basis: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Return least-squares coefficients of samples (batch, time, dof), with exact ends."""
    inner, ends = basis[:, 1:-1], basis[:, [0, -1]]
    outer = samples[:, [0, -1]]
    middle = np.linalg.pinv(inner) @ (samples - ends @ outer)
    return np.concatenate([outer[:, :1], middle, outer[:, 1:]], axis=1)


# Motions from point to point as a pymoo problem.


@dataclass(frozen=True, kw_only=True)
class PointToPointOptions:
    """Settings of genes and of the check between samples."""

    coefficient_range: float = 1.5  # rad or m: largest distance of a coefficient from its base
    slider_overshoot: float = 0.5  # share of a slider's range by which coefficients may exceed it if samples do not
    shortest_interval: float = 1e-6  # s: shortest interval, used if nothing moves
    longest_interval: float = 10.0  # longest interval if functions use times, in mean intervals of the quickest path
    refinement: int = 8  # number of parts of an interval that are checked


OPTIONS = PointToPointOptions()


class PointToPoint(DenseFormulation):
    """Move the tool from ``start`` to ``target`` fast and with little work.

    A vectorised pymoo problem.

    Objectives:

    - ``duration`` [s]: least time within the motors' curves under the load of gravity
    - ``energy`` [J], if ``energy``: absolute work of all motors
    - the user's own

    Inertia is neglected (quasi-static). Every motion of a front has its own times. ``pk.refine`` refines fronts by
    exact gradients.

    Parameters
    ----------
    arm
        Arm with more joints than coordinates of the tool's position, and gravity as it is mounted.
    actuation
        Motors or sliders that drive the arm.
    start
        Position of the tool at the start, (2,) for planar arms, else (3,) [m], in any posture.
    target
        Position of the tool at the end, (2,) for planar arms, else (3,) [m], in any posture.
    samples
        Number of samples of a motion.
    coefficients
        Number of spline coefficients per joint and slider.
    energy
        Flag: whether the work of motors is an objective. It must be False for an arm without weight in its plane, whose
        work is 0.
    objectives
        User's functions decorated with ``@objective``, of any form. Each motion has its own times, rates by backward
        differences, and torques with inertia. If functions depend on times, motions may be slower than motors need: up
        to ten times as slow as the quickest initial path.
    constraints
        User's functions decorated with ``@constraint``, of any form; their motions are the same.
    bases
        Largest number of initial paths in different postures; they are curved if straight ones are out of reach.
    seed
        Seed of the initial paths; genes depend on it.

    Notes
    -----
    Genes: the base, the difference of each joint's coefficients from the base's, the coefficients of the front sliders
    as shares of their range, and the intervals of time if functions depend on times.

    Raises
    ------
    InvalidInput
        Names the argument that cannot be used.
    OutOfReach
        If start or target, or all paths between them, cannot be reached.
    Infeasible
        If there is no path along which motors can hold the arm; names joint, torque and limit.
    """

    computed_attributes = ("initial_paths",)
    constraint_names: tuple[str, ...] = ("ends", "joint limits", "motors", "sliders")
    constraint_units: tuple[str, ...] = ("times what is accepted", "rad or m", "of what they can bear", "of the rod")

    def __init__(
        self,
        arm: Arm,
        actuation: Actuation,
        start: object,
        target: object,
        *,
        samples: int = 17,
        coefficients: int = 6,
        energy: bool = True,
        objectives: Sequence[Objective] = (),
        constraints: Sequence[Constraint] = (),
        bases: int = 12,
        seed: int = 0,
    ) -> None:
        check_actuation(actuation, arm)
        counts = {"samples": (samples, 5), "coefficients": (coefficients, 4), "bases": (bases, 1), "seed": (seed, 0)}
        for name, (value, least) in counts.items():
            check_size(name, value, least)
        if coefficients > samples:
            raise InvalidInput(f"coefficients must be at most {samples}, one per sample, got {coefficients}")
        task = 2 if arm.is_planar else 3
        if arm.dof <= task:
            raise InvalidInput(f"{arm.name} must have more than {task} joints, to choose among paths, got {arm.dof}")
        ends = [finite_array(name, place, (task,)) for name, place in (("start", start), ("target", target))]
        if np.linalg.norm(ends[1] - ends[0]) < 1e-9:
            raise InvalidInput(f"target must differ from start, got {ends[1].tolist()} m for both")
        self.arm, self.actuation, self.start, self.target = arm, actuation, *ends
        self.ends = stationary_task(arm, self.start), stationary_task(arm, self.target)
        check_flag("energy", energy)
        if energy:
            require_weight(arm)
        built_in, path = 1 + energy, line(*ends, duration=1.0, samples=samples, timing="uniform")
        self.names, self.units, self.maximised = (
            ("duration", "energy")[:built_in],
            ("s", "J")[:built_in],
            (False,) * built_in,
        )
        self.add_functions(function_task(arm, path, objectives, constraints))
        self.initial_paths: InitialPaths = find_initial_paths(
            arm, actuation, *ends, samples=samples, coefficients=coefficients, bases=bases, seed=seed
        )
        self.base_count, size = len(self.initial_paths.q), self.initial_paths.size
        self.own_times = read_times(self.functions, self._base_motions)
        sizes = [1, size, size * isinstance(actuation, DistributedActuation), (samples - 1) * self.own_times]
        super().__init__(
            np.repeat([0.0, -OPTIONS.coefficient_range, -OPTIONS.slider_overshoot, 0.0], sizes),
            np.repeat([1.0, OPTIONS.coefficient_range, 1.0 + OPTIONS.slider_overshoot, 1.0], sizes),
        )

    def profiles(self, genes: Genes) -> tuple[JointPaths, JointPaths, Float[np.ndarray, " points"]]:
        """Return coefficients (points, coefficients, dof) of joints and front sliders, and the ends' errors."""
        paths, which = self.initial_paths, self.base_indices(genes)
        q = paths.q[which] + genes[:, 1 : 1 + paths.size].reshape(len(genes), *paths.q.shape[1:])
        error = np.zeros(len(q))
        for end, at_rest in zip((0, -1), self.ends, strict=True):
            retracted = retract(self.arm, at_rest.tasks, q[:, end], at_rest.targets[0], paths.across[which, end])
            q[:, end], error = retracted.q, np.maximum(error, retracted.error)
        if not isinstance(self.actuation, DistributedActuation):
            return q, np.zeros_like(q), error
        return q, front_sliders(self.actuation, genes[:, 1 + paths.size : 1 + 2 * paths.size].reshape(q.shape)), error

    def timing(self, genes: Genes) -> Timing:
        """Return the least times and the work of individuals (points, n_var)."""
        return minimum_timing(self.arm, self.actuation, *self._samples(genes)[:2])

    def _samples(self, genes: Genes) -> tuple[JointPaths, JointPaths, Float[np.ndarray, " points"]]:
        """Return positions (points, time, dof) of joints and front sliders, and the ends' errors."""
        q, front, error = self.profiles(genes)
        spline = self.initial_paths.spline
        return spline @ q, spline @ front, error

    def sliders(self, genes: Genes) -> Float[np.ndarray, "points time 2 dof"] | None:
        """Return front and back sliders at the samples [m]; None without sliders."""
        if not isinstance(self.actuation, DistributedActuation):
            return None
        q, front, _ = self._samples(genes)
        return np.stack([front, self.actuation.gears(q, front)[0]], axis=2)

    @of_genes
    def decode(self, genes: Genes) -> Motion:
        """Return the motions (points, time, dof) of genes, each with its own times."""
        q, front, _ = self._samples(genes)
        return self._motions(q, self._intervals(genes, minimum_timing(self.arm, self.actuation, q, front)))

    def _intervals(self, genes: Genes, timing: Timing) -> Float[np.ndarray, "points intervals"]:
        """Return the intervals of individuals [s]: the least possible ones, or longer ones set by the genes."""
        if not self.own_times:
            return timing.intervals
        wishes = genes[:, -timing.intervals.shape[1] :] * (OPTIONS.longest_interval * self.initial_paths.pace)
        return np.maximum(timing.intervals, wishes)

    def _motions(self, q: JointPaths, intervals: Float[np.ndarray, "points intervals"]) -> Motion:
        steps = np.maximum(np.nan_to_num(intervals, nan=1.0), OPTIONS.shortest_interval)
        time = np.concatenate([np.zeros((len(q), 1)), np.cumsum(steps, axis=1)], axis=1)
        return Motion(arm=self.arm, time=time, q=q, differences="backward")

    def points(self, genes: Genes) -> Float[np.ndarray, "points unknowns"]:
        """Return the smooth program's unknowns for genes."""
        paths = self.initial_paths
        q, front, _ = self.profiles(genes)
        timing = minimum_timing(self.arm, self.actuation, paths.spline @ q, paths.spline @ front)
        intervals = self._intervals(genes, timing)
        extra = self.whole_program.own.values(self._motions(paths.spline @ q, intervals))
        return np.concatenate([self._unscaled.unknowns(q, front, intervals, timing.work), extra], axis=1)

    def genes(self, x: Float[np.ndarray, "points unknowns"]) -> Genes:
        """Return the genes of unknowns, or the nearest within their bounds."""
        paths = self.initial_paths
        q, front = self._unscaled.coefficients(x)
        difference = q[:, None] - paths.q
        which = np.abs(difference).max(axis=(2, 3)).argmin(axis=1)
        genes = [((which + 0.5) / len(paths.q))[:, None], difference[np.arange(len(q)), which].reshape(len(q), -1)]
        if isinstance(self.actuation, DistributedActuation):
            genes.append(slider_shares(self.actuation, front).reshape(len(q), -1))
        if self.own_times:
            genes.append(x[:, self._unscaled.slices["times"]] / OPTIONS.longest_interval)
        return np.asarray(np.clip(np.concatenate(genes, axis=1), self.xl, self.xu))

    def violation_between(self, genes: Genes) -> Float[np.ndarray, " points"]:
        """Return the largest violation (points,) between samples; 0 without a violation.

        It is the largest of three: the extra time that motors need for an interval, in mean intervals; the overload of
        motors; the violation of constraints. Intervals are divided into eight parts and timed again.
        """
        q, front, _ = self.profiles(genes)
        spline, times = self.initial_paths.finer(OPTIONS.refinement), OPTIONS.refinement
        intervals = self._intervals(genes, self.timing(genes))
        retimed = minimum_timing(self.arm, self.actuation, spline @ q, spline @ front)
        finer = self._motions(spline @ q, np.repeat(intervals / times, times, axis=1))
        excess = self.functions.violations(finer).max(axis=1, initial=0.0)
        return np.maximum(np.maximum(retimed.lateness(intervals), retimed.overload), excess)

    def sample_starts(self, count: int, rng: np.random.Generator) -> Genes:
        """Return genes of the bases, unchanged and slightly changed."""
        paths, rows = self.initial_paths, np.zeros((count, self.n_var))
        which = np.arange(count) % len(paths.q)
        rows[:, 0] = (which + 0.5) / len(paths.q)
        distance = np.where(np.arange(count) < len(paths.q), 0.0, 0.1)[:, None]
        rows[:, 1 : 1 + paths.size] = distance * rng.normal(size=(count, paths.size))
        if isinstance(self.actuation, DistributedActuation):
            shares = paths.shares[which].reshape(count, -1)
            shares = np.clip(shares + distance * rng.normal(size=shares.shape), 0.0, 1.0)
            rows[:, 1 + paths.size : 1 + 2 * paths.size] = shares
        if self.own_times:  # half of them take their least times
            longest, steps = OPTIONS.longest_interval, len(paths.spline) - 1
            rows[::2, -steps:] = longest ** rng.uniform(-1.0, 0.0, (len(rows[::2]), 1))
        return np.clip(rows, self.xl, self.xu)

    @cached_property
    def _unscaled(self) -> PointToPointProgram:
        paths = self.initial_paths
        return PointToPointProgram(
            arm=self.arm,
            actuation=self.actuation,
            start=self.start,
            target=self.target,
            spline=paths.spline,
            pace=paths.pace,
            work_unit=paths.work_unit,
        )

    @cached_property
    def _base_motions(self) -> Motion:
        """Initial paths in their least times."""
        paths = self.initial_paths
        q, front = paths.spline @ paths.q, front_sliders(self.actuation, paths.spline @ paths.shares)
        return self._motions(q, minimum_timing(self.arm, self.actuation, q, front).intervals)

    @cached_property
    def whole_program(self) -> WholeProgram:
        """Rows and costs of coefficients, intervals and work."""
        program = self._unscaled
        return WholeProgram(
            base=program.with_longest(OPTIONS.longest_interval) if self.own_times else program.program,
            base_costs=program.costs[: len(self.names) - len(self.functions.objectives)],
            task=self.functions,
            near=self._base_motions,
            lanes=program.lanes,
            intervals=np.arange(program.count)[program.slices["times"]],
            pace=program.pace,
        )

    def _evaluate(self, X: Genes, out: dict[str, Any], *args: object, **kwargs: object) -> None:
        q, front, error = self._samples(X)
        with np.errstate(invalid="ignore"):
            timing = minimum_timing(self.arm, self.actuation, q, front)
            intervals = self._intervals(X, timing)
            joints, sliders = range_excess(self.arm, self.actuation, q, front)
        own, limits, out["cause"] = evaluate_motions(self.functions, self._motions(q, intervals), interruptible=False)
        built_in = np.stack([intervals.sum(axis=1), timing.energy], axis=1)[:, : len(self.names) - own.shape[1]]
        F = np.concatenate([built_in, own], axis=1)
        excess = np.column_stack([joints, timing.overload, sliders, limits]) - LIMIT_TOLERANCE
        G = np.column_stack([error / ON_PATH_TOLERANCE - 1.0, excess])
        invalid = ~np.isfinite(F).all(axis=1)
        out["F"] = np.where(invalid[:, None], 1e6, F)
        out["G"] = np.where(np.isnan(G), 1.0, np.where(invalid[:, None], np.maximum(G, 1e-3), G))

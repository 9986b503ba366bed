"""Initial paths from point to point, as splines in different postures.

Paths are straight or bowed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import JointPaths
from paretoik.capability.actuation import Actuation, DistributedActuation
from paretoik.capability.joint_capability import joint_speeds, overload_error
from paretoik.capability.point_to_point_program import minimum_timing
from paretoik.capability.postures import restrict_to_rods, sample_holdable_postures
from paretoik.errors import Infeasible, OutOfReach
from paretoik.formulations.dense_formulation import front_sliders, slider_shares
from paretoik.formulations.encoding import clamped_spline
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import gravity_torques
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import joint_travel
from paretoik.task.path import line, waypoints
from paretoik.task.random_starts import rollout_starts, travelling_starts
from paretoik.task.retraction import retract, task_errors
from paretoik.task.validation import motion_task


@dataclass(frozen=True, kw_only=True)
class InitialPathOptions:
    """Settings of the search for initial paths."""

    rollouts: int = 256  # number of sampled postures at each end, and of sampled motions of each kind along a line
    bows: tuple[float, ...] = (0.5, 1.0, 2.0)  # sideways, as shares of a straight line that cannot be followed
    fixed_sliders: int = 5  # number of places at which fixed sliders are tried
    work_unit: float = 1e-6  # J: smallest unit; without gravity there is no work
    distance: float = 0.2  # rad or m: least distance between the coefficients of two paths


OPTIONS = InitialPathOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class InitialPaths:
    """Splines of joint positions, and of sliders as shares of their range."""

    arm: Arm
    actuation: Actuation
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
        """Return the spline with samples that are ``times`` times finer."""
        samples = times * (len(self.spline) - 1) + 1
        return clamped_spline(np.linspace(0.0, 1.0, samples), self.spline.shape[1])

    def retract_ends(
        self, q: JointPaths, which: Int[np.ndarray, " points"], ends: Sequence[MotionTask]
    ) -> Float[np.ndarray, " points"]:
        """Move spline ends to the tool's targets; return the remaining errors.

        ``which``: bases of the splines
        """
        error = np.zeros(len(q))
        for end, stationary in zip((0, -1), ends, strict=True):
            retracted = retract(self.arm, stationary.tasks, q[:, end], stationary.targets[0], self.across[which, end])
            q[:, end] = retracted.q
            error = np.maximum(error, retracted.error)
        return error


def range_excess(
    arm: Arm, actuation: Actuation, q: JointPaths, front: JointPaths
) -> tuple[Float[np.ndarray, " points"], Float[np.ndarray, " points"]]:
    """Return the largest excess of joints and sliders over their bounds.

    Joints in [rad, m], sliders as shares of the rod, at samples.
    """
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
    """Return paths from start to target that motors can hold.

    The quickest paths come first, at most ``bases``. Paths are straight, or bowed sideways if a straight one cannot be
    followed. Raises OutOfReach and Infeasible if there are none; Infeasible names a joint.
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
        feasible = _least_violating(arm, actuation, q, worst)[:bases]
    order = feasible[np.argsort(np.nan_to_num(timing.duration[feasible], nan=np.inf), kind="stable")]
    rows = [int(order[0])]  # the first few that are far enough from each other
    for row in order[1:]:
        if len(rows) < bases and np.abs(splines[rows] - splines[row]).max(axis=(1, 2)).min() > OPTIONS.distance:
            rows.append(int(row))
    # The directions in which the task changes at either end are those of the Jacobian's rows.
    jacobian = task_errors(task.arm, task.tasks, splines[:, [0, -1]], task.targets[[0, -1]])[1]
    return InitialPaths(
        arm=arm,
        actuation=actuation,
        q=splines[rows],
        shares=shares[rows],
        spline=basis,
        across=np.linalg.qr(jacobian.swapaxes(-1, -2))[0][rows],
        pace=float(np.nan_to_num(timing.duration[rows[0]], nan=1.0)) / (samples - 1),
        work_unit=max(float(np.nan_to_num(timing.work[rows[0]], nan=1.0).mean()), OPTIONS.work_unit),
    )


def _follow_lines(
    arm: Arm, actuation: Actuation, start: np.ndarray, target: np.ndarray, samples: int, rng: np.random.Generator
) -> tuple[MotionTask, Float[np.ndarray, "found time dof"]]:
    """Return the first line that can be followed, and motions along it.

    The straight line is tried before several bowed ones.
    """
    lines = [line(start, target, duration=1.0, samples=samples, timing="uniform")]
    sideways = np.linalg.svd((target - start)[None])[2][1:] * np.linalg.norm(target - start)
    for bow in OPTIONS.bows:
        middles = [(start + target) / 2 + bow * side for side in (*sideways, *-sideways)]
        lines += [
            waypoints(np.stack([start, middle, target]), duration=1.0, samples=samples, timing="uniform")
            for middle in middles
        ]
    for name, place in (("start", start), ("target", target)):
        try:
            sample_holdable_postures(arm, actuation, place, OPTIONS.rollouts, rng)
        except (OutOfReach, Infeasible) as fault:
            raise _with_message(f"{name}: {fault}", fault) from fault
    faults = list[OutOfReach | Infeasible]()
    for path in lines:
        task = motion_task(arm, path, objectives=[joint_travel], differences="backward")
        try:
            return task, np.concatenate(
                [rollout_starts(task, OPTIONS.rollouts, rng), travelling_starts(task, OPTIONS.rollouts, rng)]
            )
        except (OutOfReach, Infeasible) as fault:
            faults.append(fault)
    raise _with_message(f"start to target: no path was found, straight or bowed; straight, the {faults[0]}", faults[0])


def _with_message(text: str, fault: OutOfReach | Infeasible) -> OutOfReach | Infeasible:
    if isinstance(fault, OutOfReach):
        return OutOfReach(text, sample=fault.sample)
    return Infeasible(text, limit=fault.limit, violation=fault.violation)


def _initial_sliders(actuation: Actuation, arm: Arm, basis: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Return slider coefficients to try, grouped by path.

    Candidates are the sliders at which joints are fastest, sliders in the middle of the feasible range, and fixed
    sliders: the fastest ones may need long travel.
    """
    if not isinstance(actuation, DistributedActuation):
        return np.zeros_like(coefficients)
    q = basis @ coefficients
    speeds = joint_speeds(actuation, q, gravity_torques(arm, q))
    fastest = np.where(np.isnan(speeds.high), np.nan, slider_shares(actuation, speeds.front_high))
    best = np.clip(_fit_spline(basis, np.nan_to_num(fastest, nan=0.5)), 0.0, 1.0)
    fixed = np.linspace(0.0, 1.0, OPTIONS.fixed_sliders)[:, None, None] * np.ones_like(best[:1])
    steady = np.repeat(best.mean(axis=1, keepdims=True), best.shape[1], axis=1)
    # The middle of the front sliders' ranges that keep back sliders within bounds.
    places, fits = np.linspace(0.0, 1.0, 4 * OPTIONS.fixed_sliders + 1), list[np.ndarray]()
    for share in places:
        back = actuation.gears(q, front_sliders(actuation, np.full(q.shape, share)))[0]
        fits.append((back >= actuation.back_bounds[:, 0]) & (back <= actuation.back_bounds[:, 1]))
    middles = np.tensordot(places, np.array(fits, dtype=float), axes=1) / np.maximum(np.sum(fits, axis=0), 1)
    middle = np.clip(_fit_spline(basis, middles), 0.0, 1.0)
    candidates = [best, steady, middle, *(np.repeat(one[None], len(best), axis=0) for one in fixed)]
    return np.stack(candidates, axis=1).reshape(-1, *best.shape[1:])


def _least_violating(arm: Arm, actuation: Actuation, q: np.ndarray, worst: np.ndarray) -> np.ndarray:
    """Return the paths that motors can hold at every sample.

    Samples are checked separately. The least-violating path comes first. Raises Infeasible, naming joint, torque and
    limit, if there are none.
    """
    holdable = ~np.isnan(joint_speeds(actuation, q, gravity_torques(arm, q)).high).any(axis=(1, 2))
    if not holdable.any():
        index = int(np.argmin(worst))
        load = gravity_torques(arm, q[index])
        sample = int(np.isnan(joint_speeds(actuation, q[index], load).high).any(axis=1).argmax())
        raise overload_error(actuation, arm, q[index, sample], load[sample])
    return np.flatnonzero(holdable)[np.argsort(worst[holdable])]


def _fit_spline(basis: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Return the coefficients nearest to samples (batch, time, dof).

    Both ends are exact.
    """
    inner, ends = basis[:, 1:-1], basis[:, [0, -1]]
    outer = samples[:, [0, -1]]
    middle = np.linalg.pinv(inner) @ (samples - ends @ outer)
    return np.concatenate([outer[:, :1], middle, outer[:, 1:]], axis=1)

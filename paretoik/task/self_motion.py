"""Branches, self-motion curves, and charts of the self-motion manifold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.interpolate import CubicHermiteSpline

from paretoik.arrays import JointPaths
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import characteristic_length, jacobian, joint_scales, link_nodes
from paretoik.stop_flag import check_interruption
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.random_starts import MOTION_OPTIONS as STARTS
from paretoik.task.random_starts import posture_distance, reach_error, sample_postures, wrap_difference
from paretoik.task.retraction import relative_errors, retract, row_space_basis

# Branches: signs of bent joints as labels of motions.


def bend_signs(arm: Arm, q: Float[np.ndarray, "*batch dof"]) -> Int[np.ndarray, "*batch inner"]:
    """Return the sign of every inner joint's bend: shoulder, elbow, wrist.

    The sign is 0 if the joint is straight. For three consecutive axes it is the sign of their triple product; for
    parallel axes it is the sign of the turn from one link to the next. The sign changes only if a joint aligns its
    neighbours. Arms of two joints or fewer have no inner joint.
    """
    if arm.dof < 3:
        return np.zeros((*q.shape[:-1], 0), dtype=int)
    axes, origins = _axes(arm, q), link_nodes(arm, q)[..., 1:, :]
    before, here, after = axes[..., :-2, :], axes[..., 1:-1, :], axes[..., 2:, :]
    product = np.sum(np.cross(before, after) * here, axis=-1)
    links = np.diff(origins, axis=-2) / characteristic_length(arm)
    turn = np.sum(np.cross(links[..., :-1, :], links[..., 1:, :]) * axes[..., 1:, :], axis=-1)
    around = _axes(arm, np.arange(1.0, arm.dof + 1))  # axes parallel at one arbitrary posture always are
    parallel = np.all(np.abs(np.cross(around[:-2], around[2:])) < OPTIONS.parallel, axis=-1)
    inner = np.where(parallel, turn[..., : arm.dof - 2], product)
    last = turn[..., arm.dof - 2 :] if parallel[-1] else np.zeros((*q.shape[:-1], 0))
    signed = np.concatenate([inner, last], axis=-1)
    return np.where(np.abs(signed) < OPTIONS.parallel, 0, np.sign(signed)).astype(int)


def branch_labels(motion: Motion) -> list[str]:
    """Return a label, such as ``+-`` or ``+~``, for each motion.

    The batch is (motions, time, dof). The label has one sign per inner joint: the sign of the bend over the whole
    motion. If the joint passes through its straight position, ``~`` and the sign at the end take its place.
    """
    signs = bend_signs(motion.arm, motion.q)
    passes = (signs > 0).any(axis=-2) & (signs < 0).any(axis=-2)
    letters = np.char.add(np.where(passes, "~", ""), np.array(["-", "0", "+"])[signs[..., -1, :] + 1])
    return ["".join(row) for row in letters.tolist()]


def _axes(arm: Arm, q: np.ndarray) -> np.ndarray:
    """Return the direction of every joint's axis in the world (*batch, dof, 3)."""
    columns = np.swapaxes(jacobian(arm, q), -1, -2)
    return np.where(arm.periodic[:, None], columns[..., 3:], columns[..., :3])


# Self-motion curves of postures at redundancy one, cut into evenly spaced nodes
#
# Source: Burdick 1989 (self-motion curves).


@dataclass(frozen=True, kw_only=True)
class CurveOptions:
    """Settings of branches, of curve tracing, and of nodes on curves.

    Distances are in rad, for prismatic joints in arm lengths.
    """

    parallel: float = 1e-9  # sine of the angle below which axes count as parallel, or a joint as straight
    step_length: float = 0.1  # step length of the predictor
    turn: float = 0.9  # least cosine between the directions of two steps
    steps: int = 1200  # largest number of steps of a curve
    seeds: int = 48  # number of postures at each end of the path, continued along the path
    nodes: tuple[int, int] = (12, 500_000)  # number per largest step of a joint, and largest total number
    pair_nodes: tuple[int, int] = (10, 30_000)  # the same numbers if states are pairs of nodes


OPTIONS = CurveOptions()

Curve = tuple[np.ndarray, np.ndarray]  # steps (q, directions)


def postures_along_path(task: MotionTask, rng: np.random.Generator) -> tuple[list[np.ndarray], float]:
    """Return postures of every sample, continued from an end of the path, and the largest median joint step."""
    curves: list[list[np.ndarray]] = [[] for _ in task.times]
    pace = [0.0]
    for direction in (range(len(task.times)), reversed(range(len(task.times)))):
        q = np.empty((0, task.arm.dof))
        for i in direction:
            check_interruption()
            retracted = retract(task.arm, task.tasks, q, *self_motion_frames(task, np.full(len(q), i), q)[1:])
            moved = np.abs((retracted.q - q) / joint_scales(task.arm)).max(axis=1)
            on_path = retracted.on_path & (moved <= STARTS.longest_jump)
            q = retracted.q[on_path] if on_path.any() else sample_postures(task, OPTIONS.seeds, rng, sample=i)
            if not len(q):
                raise reach_error(task, rng, i)
            pace.append(float(np.median(moved[on_path])) if on_path.any() else 0.0)
            curves[i].append(q)
    return [np.concatenate(parts) for parts in curves], max(pace)


def self_motion_frames(
    task: MotionTask, samples: np.ndarray, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the direction of self-motion, the targets, and the normal directions at q [rad, m].

    Directions have length 1, with prismatic joints in arm lengths.
    """
    targets, scales = task.targets[samples], joint_scales(task.arm)
    jacobian = relative_errors(task.arm, task.tasks, q, targets)[1]
    across, upper = np.linalg.qr(jacobian.swapaxes(-1, -2), mode="complete")
    signs = np.where(np.diagonal(upper, axis1=-2, axis2=-1) < 0, -1.0, 1.0)
    return across[..., -1] * scales, targets, across[..., : task.rows] * signs[:, None, :] * scales[:, None]


def trace_curves(task: MotionTask, seeds: list[np.ndarray]) -> list[list[Curve]]:
    """Return the self-motion curves of every sample as steps (q, directions). Every seed is on one of the curves."""
    curves: list[list[Curve]] = [[] for _ in seeds]
    remaining = list(seeds)
    while rows := [i for i, q in enumerate(remaining) if len(q)]:
        # one curve per posture, by predictor and corrector, until it closes, stops or is too long
        samples = np.array(rows)
        begin = np.stack([remaining[i][0] for i in rows])
        q, (heading, targets, steep) = begin.copy(), self_motion_frames(task, samples, begin)
        metric = joint_scales(task.arm) ** -2.0
        first, step_length = heading.copy(), np.full(len(q), OPTIONS.step_length)
        active, count = np.arange(len(q)), np.zeros(len(q))
        steps = [(active, q.copy(), heading.copy())]
        for _ in range(OPTIONS.steps):
            check_interruption()
            reach = step_length[active]
            trial = retract(
                task.arm, task.tasks, q[active] + reach[:, None] * heading[active], targets[active], steep[active]
            )
            ahead, _, across = self_motion_frames(task, samples[active], trial.q)
            turn = (ahead * heading[active]) @ metric
            accepted = trial.on_path & (np.abs(turn) > OPTIONS.turn)
            moved = active[accepted]
            ahead *= np.sign(turn)[:, None]
            q[moved], steep[moved], heading[moved] = trial.q[accepted], across[accepted], ahead[accepted]
            count[moved] += 1
            back = wrap_difference(begin[active] - q[active], task.arm.periodic)
            closed = accepted & (np.sqrt(back**2 @ metric) < 0.6 * reach) & (count[active] > 3)
            closed &= (heading[active] * first[active]) @ metric > OPTIONS.turn
            q[active[closed]] += back[closed]
            heading[active[closed]] = first[active[closed]]  # the node at the start of the curve
            steps.append((moved, q[moved], heading[moved]))
            step_length[active] = np.where(accepted, np.minimum(1.5 * reach, OPTIONS.step_length), reach / 2)
            active = active[~closed & (step_length[active] > 1e-4)]
            if not len(active):
                break
        numbers, places, directions = (np.concatenate(parts) for parts in zip(*steps, strict=True))
        traced = [(places[numbers == k], directions[numbers == k]) for k in range(len(q))]
        for i, (q, directions) in zip(rows, traced, strict=True):
            curves[i].append((q, directions))
            distance = posture_distance(task.arm, remaining[i][:, None], q).min(axis=1)
            remaining[i] = remaining[i][distance > 0.75 * OPTIONS.step_length]
    return curves


def node_spacing(arm: Arm, curves: list[list[Curve]], windows: np.ndarray, *, second: bool) -> float:
    """Return the distance between nodes that resolves speeds, larger if there would be too many nodes."""
    shares, limit = OPTIONS.pair_nodes if second else OPTIONS.nodes
    return float(max((windows[1:] / joint_scales(arm)).max() / shares, _length(arm, curves) / limit))


def count_nodes(task: MotionTask, curves: list[list[Curve]], spacing: float) -> float:
    """Return the approximate number of nodes on curves. Nodes are counted in all turns of joints within limits."""
    lower, upper = unwrapped_ranges(task, np.zeros(task.arm.dof, dtype=bool)).T
    turns = np.where(task.arm.periodic & np.isfinite(upper - lower), (upper - lower) / (2 * np.pi), 1.0)
    return float(_length(task.arm, curves) / spacing * np.prod(np.maximum(turns, 1.0)))


def _length(arm: Arm, curves: list[list[Curve]]) -> float:
    scales = joint_scales(arm)
    return float(sum(np.linalg.norm(np.diff(q / scales, axis=0), axis=1).sum() for here in curves for q, _ in here))


def resample_curve(arm: Arm, curve: Curve, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Return evenly spaced points along a curve, and the index of each one's successor, −1 at an open end."""
    q, directions = curve
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q / joint_scales(arm), axis=0), axis=1))])
    distinct = np.append(np.diff(s) > 1e-9, True)
    if distinct.sum() < 2:
        return q[:1], np.array([-1])
    closed = bool(posture_distance(arm, q[-1], q[0]) < 1e-9)
    pieces = int(np.ceil(s[-1] / spacing))
    places = np.linspace(0, s[-1], pieces + (not closed), endpoint=not closed)
    onward = np.append(np.arange(1, len(places)), 0 if closed and pieces > 2 else -1)
    return np.asarray(CubicHermiteSpline(s[distinct], q[distinct], directions[distinct])(places)), onward


def unwrapped_ranges(task: MotionTask, unrolled: np.ndarray) -> Float[np.ndarray, "dof 2"]:
    """Return the limits of joints whose turns are counted; NaN for joints known modulo 2π."""
    ranges = task.arm.position_limits.copy()
    lower, upper = ranges.T
    ranges[np.isinf(lower) & np.isinf(upper)] = np.nan
    ranges[np.isinf(lower) & np.isfinite(upper), 0] = upper[np.isinf(lower) & np.isfinite(upper)] - 4 * np.pi
    ranges[np.isinf(upper) & np.isfinite(lower), 1] = lower[np.isinf(upper) & np.isfinite(lower)] + 4 * np.pi
    ranges[unrolled] = -2 * np.pi, 2 * np.pi
    return ranges


def unwrap_nodes(q: np.ndarray, ranges: np.ndarray, periodic: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes in all turns within joint ranges, and their original indices."""
    which = np.arange(len(q))
    for j in np.flatnonzero(periodic):
        lower, upper = (-np.pi, np.pi) if np.isnan(ranges[j, 0]) else ranges[j]
        turns = 2 * np.pi * np.arange((upper - lower) // (2 * np.pi) + 1)
        place = (lower + (q[:, j] - lower) % (2 * np.pi) + turns[:, None]).ravel()
        q, which = np.tile(q, (len(turns), 1)), np.tile(which, len(turns))
        q[:, j] = place
        q, which = q[place <= upper], which[place <= upper]
    return q, which


# Coordinates of the self-motion manifold around base motions.


@dataclass(frozen=True, kw_only=True, eq=False)
class Charts:
    """Charts around base motions: q = base + null_space · y, then retracted along ``row_space``.

    null_space: bases of the null space of the tasks' Jacobian along each base motion, transported without turning
    row_space: bases of its row space

    Both bases are orthonormal if prismatic joints are in arm lengths, so that y = null_spaceᵀ (q − base).
    """

    base: Float[np.ndarray, "bases time dof"]
    null_space: Float[np.ndarray, "bases time dof redundancy"]
    row_space: Float[np.ndarray, "bases time dof rows"]

    def at(
        self, task: MotionTask, which: np.ndarray, y: Float[np.ndarray, "*batch time redundancy"]
    ) -> tuple[JointPaths, Bool[np.ndarray, "*batch time"]]:
        """Return motions at coordinates y around bases ``which``, and which samples are on the path.

        A sample whose correction jumps relative to the sample before is on another sheet.
        """
        scales = joint_scales(task.arm)
        start = self.base[which] + np.einsum("ptdr,ptr->ptd", self.null_space[which], y) * scales
        retracted = retract(task.arm, task.tasks, start, task.targets, self.row_space[which] * scales[:, None])
        q, on_path = retracted.q, retracted.on_path
        base_step = np.abs(np.diff(start / scales, axis=1)).max(axis=2)
        on_path[:, 1:] &= np.abs(np.diff((q - start) / scales, axis=1)).max(axis=2) <= STARTS.longest_jump + base_step
        return q, on_path

    def coordinates(
        self, task: MotionTask, which: np.ndarray, q: JointPaths
    ) -> Float[np.ndarray, "*batch time redundancy"]:
        """Return the coordinates y of motions around bases ``which``."""
        return np.einsum("ptdr,ptd->ptr", self.null_space[which], (q - self.base[which]) / joint_scales(task.arm))


def build_charts(task: MotionTask, base: Float[np.ndarray, "bases time dof"]) -> Charts:
    """Return charts around base motions on the path."""
    jacobian = relative_errors(task.arm, task.tasks, base, task.targets)[1]
    null_space = np.linalg.svd(jacobian)[2][..., task.rows :, :].swapaxes(-1, -2)
    for i in range(1, base.shape[1]):  # parallel transport: each basis is as near as possible to the previous one
        left, _, right = np.linalg.svd(np.swapaxes(null_space[:, i], -1, -2) @ null_space[:, i - 1])
        null_space[:, i] = null_space[:, i] @ (left @ right)
    if task.cyclic:  # bases are turned evenly over time so that they close with the motion
        from scipy.linalg import expm, logm  # here: only cyclic motions need it

        share = task.times / task.times[-1]
        for b, basis in enumerate(null_space):
            turn = np.real(logm(basis[-1].T @ basis[0]))
            null_space[b] = basis @ np.stack([expm(part * (turn - turn.T) / 2) for part in share])
        null_space[:, -1] = null_space[:, 0]
    # Contiguous, as after unpickling in a worker: sums over views have another order and other last bits.
    return Charts(base=base, null_space=np.ascontiguousarray(null_space), row_space=row_space_basis(jacobian))

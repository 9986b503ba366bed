"""The curves that postures lie on where redundancy is one: traced, and cut into nodes evenly spaced.

Source: Burdick 1989 (self-motion curves).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicHermiteSpline

from paretoik.robot.arm import Arm
from paretoik.robot.scales import joint_scales
from paretoik.self_motion.motion_starts import OPTIONS as STARTS
from paretoik.self_motion.start_postures import posture_distance, reach_error, sample_postures, wrap_difference
from paretoik.stop_flag import check_interruption
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import relative_errors, retract


@dataclass(frozen=True, kw_only=True)
class CurveOptions:
    """How curves are traced and cut into nodes, in rad, slides in lengths of the arm."""

    step_length: float = 0.1  # of the predictor
    turn: float = 0.9  # least cosine between the directions of two steps
    steps: int = 1200  # of a curve, at most
    seeds: int = 48  # postures at either end of the path that are carried along it
    nodes: tuple[int, int] = (12, 500_000)  # in the furthest step of a joint, and at most in all
    pair_nodes: tuple[int, int] = (10, 30_000)  # the same where pairs of nodes are states


OPTIONS = CurveOptions()

Curve = tuple[np.ndarray, np.ndarray]  # steps (q, directions)


def postures_along_path(task: MotionTask, rng: np.random.Generator) -> tuple[list[np.ndarray], float]:
    """Return postures of every sample on all curves that are connected to either end, and the path's pace.

    What comes into being halfway along the path is near nothing that could lead to it.
    """
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
    """Return the direction of self-motion at postures, the targets of their samples and the directions across it.

    Directions are of length one where slides are measured in lengths of the arm; they are returned in rad and m.
    """
    targets, scales = task.targets[samples], joint_scales(task.arm)
    jacobian = relative_errors(task.arm, task.tasks, q, targets)[1]
    across, upper = np.linalg.qr(jacobian.swapaxes(-1, -2), mode="complete")
    signs = np.where(np.diagonal(upper, axis1=-2, axis2=-1) < 0, -1.0, 1.0)
    return across[..., -1] * scales, targets, across[..., : task.rows] * signs[:, None, :] * scales[:, None]


def trace_curves(task: MotionTask, seeds: list[np.ndarray]) -> list[list[Curve]]:
    """Return the self-motion curves of every sample, as steps (q, directions), until no seed is off all of them."""
    curves: list[list[Curve]] = [[] for _ in seeds]
    remaining = list(seeds)
    while rows := [i for i, q in enumerate(remaining) if len(q)]:
        traced = _trace_once(task, np.array(rows), np.stack([remaining[i][0] for i in rows]))
        for i, (q, directions) in zip(rows, traced, strict=True):
            curves[i].append((q, directions))
            distance = posture_distance(task.arm, remaining[i][:, None], q).min(axis=1)
            remaining[i] = remaining[i][distance > 0.75 * OPTIONS.step_length]
    return curves


def _trace_once(task: MotionTask, samples: np.ndarray, begin: np.ndarray) -> list[Curve]:
    """Return one curve through each posture, by predictor and corrector, until it closes, stops or is too long."""
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
        heading[active[closed]] = first[active[closed]]  # it is the node that the curve began at
        steps.append((moved, q[moved], heading[moved]))
        step_length[active] = np.where(accepted, np.minimum(1.5 * reach, OPTIONS.step_length), reach / 2)
        active = active[~closed & (step_length[active] > 1e-4)]
        if not len(active):
            break
    rows, places, directions = (np.concatenate(parts) for parts in zip(*steps, strict=True))
    return [(places[rows == k], directions[rows == k]) for k in range(len(q))]


def node_spacing(arm: Arm, curves: list[list[Curve]], windows: np.ndarray, *, second: bool) -> float:
    """Return the distance of nodes that tells enough speeds apart, or keeps the nodes few enough."""
    shares, limit = OPTIONS.pair_nodes if second else OPTIONS.nodes
    return float(max((windows[1:] / joint_scales(arm)).max() / shares, _length(arm, curves) / limit))


def count_nodes(task: MotionTask, curves: list[list[Curve]], spacing: float) -> float:
    """Return about how many nodes curves have, so far apart, at all the turns that joints' limits hold."""
    lower, upper = unwrapped_ranges(task, np.zeros(task.arm.dof, dtype=bool)).T
    turns = np.where(task.arm.periodic & np.isfinite(upper - lower), (upper - lower) / (2 * np.pi), 1.0)
    return float(_length(task.arm, curves) / spacing * np.prod(np.maximum(turns, 1.0)))


def _length(arm: Arm, curves: list[list[Curve]]) -> float:
    scales = joint_scales(arm)
    return float(sum(np.linalg.norm(np.diff(q / scales, axis=0), axis=1).sum() for here in curves for q, _ in here))


def resample_curve(arm: Arm, curve: Curve, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points evenly spaced along a curve and which of them is next to each, −1 at the end of an open one."""
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
    """Return where the turns of joints are told difference: within their limits; NaN for joints known modulo 2π."""
    ranges = task.arm.position_limits.copy()
    lower, upper = ranges.T
    ranges[np.isinf(lower) & np.isinf(upper)] = np.nan
    ranges[np.isinf(lower) & np.isfinite(upper), 0] = upper[np.isinf(lower) & np.isfinite(upper)] - 4 * np.pi
    ranges[np.isinf(upper) & np.isfinite(lower), 1] = lower[np.isinf(upper) & np.isfinite(lower)] + 4 * np.pi
    ranges[unrolled] = -2 * np.pi, 2 * np.pi
    return ranges


def unwrap_nodes(q: np.ndarray, ranges: np.ndarray, periodic: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes at all the turns that their joints' ranges hold, and which node each of them is."""
    which = np.arange(len(q))
    for j in np.flatnonzero(periodic):
        lower, upper = (-np.pi, np.pi) if np.isnan(ranges[j, 0]) else ranges[j]
        turns = 2 * np.pi * np.arange((upper - lower) // (2 * np.pi) + 1)
        place = (lower + (q[:, j] - lower) % (2 * np.pi) + turns[:, None]).ravel()
        q, which = np.tile(q, (len(turns), 1)), np.tile(which, len(turns))
        q[:, j] = place
        q, which = q[place <= upper], which[place <= upper]
    return q, which

"""The curves that postures lie on where redundancy is one: traced, and cut into nodes evenly spaced.

Source: Burdick 1989 (self-motion curves).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicHermiteSpline

from paretoik.self_motion.starts import JUMP, postures, unreachable
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import retract, task_errors

STRIDE = 0.1  # rad or m: how finely curves are traced before they are cut into nodes
SHARPEST = 0.9  # cosine of the turn from one stride to the next
STRIDES = 1200  # of one curve, at most
SEEDS = 48  # postures at either end of the path, carried along it to find the curves of every sample
NODES = 12, 500_000  # in the furthest step of a joint, and at most in all
PAIR_NODES = 10, 30_000

Curve = tuple[np.ndarray, np.ndarray]  # strides (q, directions)


def carried_postures(task: MotionTask, rng: np.random.Generator) -> tuple[list[np.ndarray], float]:
    """Return postures of every sample on all curves that are connected to either end, and the path's pace.

    What comes into being halfway along the path is near nothing that could lead to it.
    """
    found: list[list[np.ndarray]] = [[] for _ in task.times]
    pace = [0.0]
    for way in (range(len(task.times)), reversed(range(len(task.times)))):
        q = np.empty((0, task.arm.dof))
        for i in way:
            led = retract(task.arm, task.tasks, q, *aimed(task, np.full(len(q), i), q)[1:])
            moved = np.abs(led.q - q).max(axis=1)
            on_path = led.on_path & (moved <= JUMP)
            q = led.q[on_path] if on_path.any() else postures(task, SEEDS, rng, sample=i)
            if not len(q):
                raise unreachable(task, rng, i)
            pace.append(float(np.median(moved[on_path])) if on_path.any() else 0.0)
            found[i].append(q)
    return [np.concatenate(parts) for parts in found], max(pace)


def aimed(task: MotionTask, samples: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the direction of self-motion at postures, the targets of their samples and the ways that lead to them."""
    targets = task.targets[samples]
    slopes = task_errors(task.arm, task.tasks, q, targets)[1]
    across, upper = np.linalg.qr(np.moveaxis(slopes, -1, 0).swapaxes(-1, -2), mode="complete")
    signs = np.where(np.diagonal(upper, axis1=-2, axis2=-1) < 0, -1.0, 1.0)
    return across[..., -1], targets, across[..., : task.rows] * signs[:, None, :]


def traced_curves(task: MotionTask, seeds: list[np.ndarray]) -> list[list[Curve]]:
    """Return the self-motion curves of every sample, as strides (q, directions), until no seed is off all of them."""
    found: list[list[Curve]] = [[] for _ in seeds]
    left = list(seeds)
    while rows := [i for i, q in enumerate(left) if len(q)]:
        traced = traced_once(task, np.array(rows), np.stack([left[i][0] for i in rows]))
        for i, (q, directions) in zip(rows, traced, strict=True):
            found[i].append((q, directions))
            apart = wrapped(left[i][:, None] - q, task.arm.periodic)
            left[i] = left[i][np.linalg.norm(apart, axis=2).min(axis=1) > 0.75 * STRIDE]
    return found


def traced_once(task: MotionTask, samples: np.ndarray, begin: np.ndarray) -> list[Curve]:
    """Return one curve through each posture, by predictor and corrector, until it closes, stops or is too long."""
    q, (heading, targets, steep) = begin.copy(), aimed(task, samples, begin)
    first, stride, going, count = heading.copy(), np.full(len(q), STRIDE), np.arange(len(q)), np.zeros(len(q))
    strides = [(going, q.copy(), heading.copy())]
    for _ in range(STRIDES):
        reach = stride[going]
        trial = retract(task.arm, task.tasks, q[going] + reach[:, None] * heading[going], targets[going], steep[going])
        ahead, _, across = aimed(task, samples[going], trial.q)
        turn = np.sum(ahead * heading[going], axis=1)
        good = trial.on_path & (np.abs(turn) > SHARPEST)
        moved = going[good]
        q[moved], steep[moved], heading[moved] = trial.q[good], across[good], (ahead * np.sign(turn)[:, None])[good]
        count[moved] += 1
        back = wrapped(begin[going] - q[going], task.arm.periodic)
        closed = good & (np.linalg.norm(back, axis=1) < 0.6 * reach) & (count[going] > 3)
        closed &= np.sum(heading[going] * first[going], axis=1) > SHARPEST
        q[going[closed]] += back[closed]
        strides.append((moved, q[moved], heading[moved]))
        stride[going] = np.where(good, np.minimum(1.5 * reach, STRIDE), reach / 2)
        going = going[~closed & (stride[going] > 1e-4)]
        if not len(going):
            break
    rows, places, directions = (np.concatenate(parts) for parts in zip(*strides, strict=True))
    return [(places[rows == k], directions[rows == k]) for k in range(len(q))]


def node_spacing(curves: list[list[Curve]], windows: np.ndarray, *, second: bool) -> float:
    """Return the distance of nodes that tells enough speeds apart, or keeps the nodes few enough."""
    length = sum(np.linalg.norm(np.diff(q, axis=0), axis=1).sum() for here in curves for q, _ in here)
    shares, most = PAIR_NODES if second else NODES
    return float(max(windows[1:].max() / shares, length / most))


def nodes_of(task: MotionTask, curves: list[list[Curve]], spacing: float) -> float:
    """Return about how many nodes curves have, so far apart, at all the turns that joints' limits hold."""
    lower, upper = lifted_ranges(task, np.zeros(task.arm.dof, dtype=bool)).T
    turns = np.where(task.arm.periodic & np.isfinite(upper - lower), (upper - lower) / (2 * np.pi), 1.0)
    length = sum(np.linalg.norm(np.diff(q, axis=0), axis=1).sum() for here in curves for q, _ in here)
    return float(length / spacing * np.prod(np.maximum(turns, 1.0)))


def chained(q: Float[np.ndarray, "postures dof"], periodic: np.ndarray) -> Float[np.ndarray, "postures dof"]:
    """Return postures in an order in which each comes after its nearest neighbour among those before it."""
    left = list(q)
    ordered = [left.pop(0)]
    while left:
        apart = np.linalg.norm(wrapped(np.array(left) - ordered[-1], periodic), axis=1)
        ordered.append(left.pop(int(np.argmin(apart))))
    return np.array(ordered)


def wrapped(apart: np.ndarray, periodic: np.ndarray) -> np.ndarray:
    """Return joint distances with whole turns of periodic joints taken off."""
    return np.where(periodic, apart - 2 * np.pi * np.round(apart / (2 * np.pi)), apart)


def cut_evenly(curve: Curve, spacing: float, periodic: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points evenly spaced along a curve and which of them is next to each, −1 at the end of an open one."""
    q, directions = curve
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    apart = np.append(np.diff(s) > 1e-9, True)
    if apart.sum() < 2:
        return q[:1], np.array([-1])
    closed = bool(np.linalg.norm(wrapped(q[-1] - q[0], periodic)) < 1e-9)
    pieces = int(np.ceil(s[-1] / spacing))
    places = np.linspace(0, s[-1], pieces + (not closed), endpoint=not closed)
    onward = np.append(np.arange(1, len(places)), 0 if closed and pieces > 2 else -1)
    return np.asarray(CubicHermiteSpline(s[apart], q[apart], directions[apart])(places)), onward


def lifted_ranges(task: MotionTask, unrolled: np.ndarray) -> Float[np.ndarray, "dof 2"]:
    """Return where the turns of joints are told apart: within their limits; NaN for joints known modulo 2π."""
    ranges = task.arm.position_limits.copy()
    lower, upper = ranges.T
    ranges[np.isinf(lower) & np.isinf(upper)] = np.nan
    ranges[np.isinf(lower) & np.isfinite(upper), 0] = upper[np.isinf(lower) & np.isfinite(upper)] - 4 * np.pi
    ranges[np.isinf(upper) & np.isfinite(lower), 1] = lower[np.isinf(upper) & np.isfinite(lower)] + 4 * np.pi
    ranges[unrolled] = -2 * np.pi, 2 * np.pi
    return ranges


def lifted(q: np.ndarray, ranges: np.ndarray, periodic: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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

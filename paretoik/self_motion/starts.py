"""Where else the arm could be while its tasks hold: postures, whole motions, and coordinates around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.errors import Infeasible, OutOfReach
from paretoik.task.motion import steepest
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import ACCEPTED, TOLERANCE, eliminate, retract, task_errors

ATTEMPTS = 40  # Newton steps of a cold start
FARTHEST = 9.0  # rad or m: how far joints, all of them together, travel along the self-motion, at most
PUSH = 1.0  # rad or m: how far joints are pushed, RMS, where the path leaves them free to go
WIDTH = 0.3, 1.0  # share of the path in which they mostly do
JUMP = 0.7  # rad or m: no joint of a candidate moves further than this from one sample to the next


def postures(
    task: MotionTask, count: int, rng: np.random.Generator, *, sample: int = 0
) -> Float[np.ndarray, "found dof"]:
    """Return up to ``count`` postures that reach a sample, from random starts all over the joint ranges.

    Damped least squares (Nakamura & Hanafusa 1986), then Newton; those that don't arrive are left out.
    """
    q, error = _cold_start(task, np.full(count, sample), rng)
    return q[np.abs(error).max(axis=1) <= ACCEPTED]


def _cold_start(
    task: MotionTask, samples: Int[np.ndarray, " count"], rng: np.random.Generator, *, attempts: int = ATTEMPTS
) -> tuple[Float[np.ndarray, "count dof"], Float[np.ndarray, "count rows"]]:
    """Return for each sample asked for a posture near it, from a random start, and the task errors that are left."""
    q = rng.uniform(*_range(task), size=(len(samples), task.arm.dof))
    targets = task.targets[samples]
    going = np.arange(len(samples))
    for step in range(attempts):
        error, slopes = task_errors(task.arm, task.tasks, q[going], targets[going])
        jacobian = np.moveaxis(slopes, -1, 0)
        gap = np.linalg.norm(error, axis=0)
        damping = 1e-2 * gap**2 + (1e-3 if step < 5 else 1e-12)
        if step >= ATTEMPTS:
            damping = gap  # the target may be out of reach: with less it would swing about the nearest point for ever
        square = jacobian @ np.swapaxes(jacobian, -1, -2) + damping[:, None, None] * np.eye(task.rows)
        move = (np.swapaxes(jacobian, -1, -2) @ eliminate(square, error.T)[0][..., None])[..., 0]
        q[going] += move / np.maximum(1.0, np.abs(move).max(axis=1, keepdims=True) / 0.5)
        going = going[gap > TOLERANCE]
        if len(going) == 0:
            break
    turning = task.arm.periodic & ~np.isfinite(task.arm.position_limits).all(axis=1)
    q[:, turning] = (q[:, turning] + np.pi) % (2 * np.pi) - np.pi
    return q, task_errors(task.arm, task.tasks, q, targets)[0].T


def _range(task: MotionTask) -> tuple[np.ndarray, np.ndarray]:
    lower, upper = task.arm.position_limits.T
    width = np.where(task.arm.periodic, 2 * np.pi, 2.0)
    low = np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper - width, -width / 2))
    return low, np.where(np.isfinite(upper), upper, low + width)


def candidates(task: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "found time dof"]:
    """Return up to ``count`` motions on the path, by roll-outs of weighted pseudoinverses.

    Each starts at another posture (or all at the given one) and weighs the joints by its own random symmetric matrix
    with eigenvalues in (0, 1); the whole is then led onto the path. Source: Tringali & Cocuzza 2020, section 3.1.2.

    Raises OutOfReach, naming the sample, where no posture reaches the path; Infeasible where postures exist everywhere
    but no continuous motion was found.
    """
    start = _starts(task, count, rng)
    if len(start) == 0:
        raise unreachable(task, rng, 0)
    q, came = _roll_outs(task, start, rng, np.zeros((len(start), len(task.times) - 1)))
    if not len(q):
        raise unreachable(task, rng, came)
    q, on_path = _onto_path(task, _without_drift(task, q) if task.cyclic else q)
    kept = on_path.all(axis=1)
    if not kept.any():
        raise unreachable(task, rng, int(np.argmin(on_path, axis=1).max()))
    return q[kept]


def swept(task: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "found time dof"]:
    """Return up to ``count`` motions on the path that travel along the self-motion meanwhile.

    Roll-outs alone move little: they do not pass through the postures between one way to bend the arm and another.
    Each travels so far, and mostly at such a time, as chance has it; cyclic motions there and back.
    Source: Tringali & Cocuzza 2020, Eq. 17, along the path instead of before it.
    """
    steps = len(task.times) - 1
    share, shape = (np.arange(steps) + 0.5) / steps, (count, 1)
    way = FARTHEST * rng.uniform(0.0, 1.0, shape) ** 2
    if task.cyclic:
        pace = way * np.pi / (2 * steps) * np.cos(2 * np.pi * (share - rng.uniform(0.0, 1.0, shape)))
    else:
        bump = np.exp(-(((share - rng.uniform(0.0, 1.0, shape)) / rng.uniform(*WIDTH, shape)) ** 2) / 2)
        pace = way * bump / bump.sum(axis=1, keepdims=True)
    start = _starts(task, count, rng)
    q, _ = _roll_outs(task, start, rng, pace[: len(start)])
    q, on_path = _onto_path(task, _without_drift(task, q) if task.cyclic else q)
    if task.start is not None:
        q[:, 0] = task.start
    return q[on_path.all(axis=1)]


def pushed(
    task: MotionTask, q: Float[np.ndarray, "motions time dof"], rng: np.random.Generator
) -> Float[np.ndarray, "found time dof"]:
    """Return motions on the path near given ones, which all joints are pushed away from at random.

    Most at both ends (in cyclic motions at opposite points), less in between, along the null space of the tasks'
    Jacobian; then they are led back. Motions that leave the path or jump are left out.
    """
    share, shape = task.times / task.times[-1], (len(q), 1, task.arm.dof)
    first, last = PUSH * rng.normal(size=shape), PUSH * rng.normal(size=shape)
    if task.cyclic:
        wave = np.cos(2 * np.pi * (share - rng.uniform(size=(len(q), 1))))[..., None]
        away = first * (1 + wave) / 2 + last * (1 - wave) / 2
    else:
        away = first * (1 - share)[:, None] * (task.start is None) + last * share[:, None]
    slopes = task_errors(task.arm, task.tasks, q.reshape(-1, task.arm.dof), np.tile(task.targets, (len(q), 1)))[1]
    rows = steepest(slopes).reshape(*q.shape, task.rows)
    found, on_path = _onto_path(task, q + away - np.einsum("ptdk,ptek,pte->ptd", rows, rows, away))
    if task.start is not None:
        found[:, 0] = task.start
    return found[on_path.all(axis=1)]


def _starts(task: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "found dof"]:
    return postures(task, count, rng) if task.start is None else np.tile(task.start, (count, 1))


def _roll_outs(
    task: MotionTask,
    start: Float[np.ndarray, "count dof"],
    rng: np.random.Generator,
    pace: Float[np.ndarray, "count steps"],
) -> tuple[Float[np.ndarray, "found time dof"], int]:
    """Return motions near the path, and the sample that the last of them came to.

    One Newton step a sample, each making good what the one before left, and ``pace`` [rad, m] along the self-motion.
    """
    inverses = _inverse_weights(len(start), task.arm.dof, rng)
    along = rng.normal(size=start.shape)
    q = np.empty((len(start), len(task.times), task.arm.dof))
    q[:, 0] = start
    alive = np.ones(len(start), dtype=bool)
    for i in range(1, len(task.times)):
        here = q[alive, i - 1]
        error, slopes = task_errors(task.arm, task.tasks, here, np.tile(task.targets[i], (len(here), 1)))
        jacobian = np.moveaxis(slopes, -1, 0)
        spread = inverses[alive] @ np.swapaxes(jacobian, -1, -2)
        with np.errstate(all="ignore"):  # at a singularity steps grow without bound, and the jump ends the roll-out
            move = (spread @ eliminate(jacobian @ spread, error.T)[0][..., None])[..., 0]
        if pace.any():
            along[alive] = _freed(steepest(slopes), along[alive])
            move += pace[alive, i - 1, None] * along[alive]
        q[alive, i] = here + move
        alive[alive] = np.abs(move).max(axis=1) <= JUMP
        if not alive.any():
            return q[:0], i
    return q[alive], len(task.times) - 1


def _freed(rows: np.ndarray, along: Float[np.ndarray, "count dof"]) -> Float[np.ndarray, "count dof"]:
    """Return unit directions of self-motion nearest to given ones; ``rows`` (count, dof, rows) move the tool."""
    left = along - np.einsum("pdk,pek,pe->pd", rows, rows, along)
    return left / np.maximum(np.linalg.norm(left, axis=1, keepdims=True), 1e-12)


def unreachable(task: MotionTask, rng: np.random.Generator, near: int) -> OutOfReach | Infeasible:
    """Return the error that says why no motion gets past sample ``near``."""
    _, error = _cold_start(task, np.repeat(np.arange(len(task.times)), 32), rng)
    missed = np.abs(error).max(axis=1).reshape(-1, 32).min(axis=1) > ACCEPTED
    for sample in np.flatnonzero(
        missed
    ).tolist():  # few starts did not reach it: ask in earnest before it is called out of reach
        _, error = _cold_start(task, np.full(256, sample), rng, attempts=5 * ATTEMPTS)
        if np.abs(error).max(axis=1).min() > ACCEPTED:
            nearest = error[int(np.argmin(np.sum(error**2, axis=1)))]
            return OutOfReach(
                f"path leaves reach at sample {sample} ({task.times[sample]:.3g} s): {_gap(task, sample, nearest)}",
                sample=sample,
            )
    if task.cyclic:
        return Infeasible("no cyclic motion was found: every candidate that follows the path ends in another posture")
    q = postures(task, 64, rng, sample=near)
    slopes = task_errors(task.arm, task.tasks, q, np.tile(task.targets[near], (len(q), 1)))[1]
    condition = float(np.linalg.cond(np.moveaxis(slopes, -1, 0)).min())
    return Infeasible(
        f"every sample can be reached, but no continuous motion passes sample {near} ({task.times[near]:.3g} s): a "
        f"singularity, a gap between branches or samples too far apart (least condition number of the Jacobian there: "
        f"{condition:.3g})"
    )


def _gap(task: MotionTask, sample: int, error: Float[np.ndarray, " rows"]) -> str:
    """Return in words how far the nearest posture found is from a sample, for the task that is missed most."""
    gaps, row, column = [], 0, 0
    for asked in task.tasks:
        size = 2 if asked.axes in ("xy", "xy+angle") else 3
        wanted, left = task.targets[sample, column : column + size], error[row : row + asked.rows]
        gaps.append((float(np.linalg.norm(left)), wanted, left[:size], left[size:]))
        row, column = row + asked.rows, column + asked.numbers
    _, wanted, off, turn = max(gaps, key=lambda gap: gap[0])
    turned = f", there turned {np.linalg.norm(turn):.3g} rad away" if len(turn) else ""
    return (
        f"{(np.round(wanted, 6) + 0.0).tolist()} m is {np.linalg.norm(off):.3g} m from the nearest point found, "
        f"{(np.round(wanted - off, 6) + 0.0).tolist()} m{turned}"
    )


def _inverse_weights(count: int, dof: int, rng: np.random.Generator) -> Float[np.ndarray, "count dof dof"]:
    basis = np.linalg.qr(rng.normal(size=(count, dof, dof)))[0]
    eigenvalues = rng.uniform(0.02, 1.0, size=(count, dof))
    return (basis / eigenvalues[:, None, :]) @ np.swapaxes(basis, -1, -2)


def _without_drift(task: MotionTask, q: Float[np.ndarray, "motions time dof"]) -> Float[np.ndarray, "motions time dof"]:
    """Return motions that end in the posture they start from, their drift taken out evenly over time."""
    drift = q[:, -1:] - q[:, :1]
    drift = np.where(task.arm.periodic, (drift + np.pi) % (2 * np.pi) - np.pi, drift)
    return q - (task.times / task.times[-1])[None, :, None] * drift


def _onto_path(
    task: MotionTask, q: Float[np.ndarray, "motions time dof"]
) -> tuple[Float[np.ndarray, "motions time dof"], Bool[np.ndarray, "motions time"]]:
    """Return motions led to the path the shortest way, and which of their samples arrived there without a jump."""
    flat, targets = q.reshape(-1, task.arm.dof), np.tile(task.targets, (len(q), 1))
    slopes = task_errors(task.arm, task.tasks, flat, targets)[1]
    directions = slopes / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-12)
    found = retract(task.arm, task.tasks, flat, targets, np.transpose(directions, (2, 1, 0)))
    led, on_path = found.q.reshape(q.shape), found.on_path.reshape(q.shape[:2])
    if task.cyclic:
        led[:, -1] = led[:, 0]
    on_path[:, 1:] &= np.abs(np.diff(led, axis=1)).max(axis=2) <= JUMP
    return led, on_path


@dataclass(frozen=True, kw_only=True, eq=False)
class Charts:
    """Coordinates around base motions: q = base + normal · y, then along ``steep`` onto the path.

    ``normal`` spans the null space of the tasks' Jacobian along each base, transported without turning; ``steep`` spans
    its row space. Both are orthonormal, so y = normalᵀ (q − base) gives the coordinates back.
    """

    base: Float[np.ndarray, "bases time dof"]
    normal: Float[np.ndarray, "bases time dof redundancy"]
    steep: Float[np.ndarray, "bases time dof rows"]

    def at(
        self, task: MotionTask, which: np.ndarray, y: Float[np.ndarray, "motions time redundancy"]
    ) -> tuple[Float[np.ndarray, "motions time dof"], Bool[np.ndarray, "motions time"]]:
        """Return motions at coordinates y around bases ``which``, and which of their samples are on the path.

        A sample whose way to the path jumps from that of the sample before has come to another sheet, and is off.
        """
        start = self.base[which] + np.einsum("ptdr,ptr->ptd", self.normal[which], y)
        count = len(which)
        found = retract(
            task.arm,
            task.tasks,
            start.reshape(-1, task.arm.dof),
            np.tile(task.targets, (count, 1)),
            self.steep[which].reshape(-1, task.arm.dof, task.rows),
        )
        q, on_path = found.q.reshape(start.shape), found.on_path.reshape(start.shape[:2])
        pace = np.abs(np.diff(start, axis=1)).max(axis=2)
        on_path[:, 1:] &= np.abs(np.diff(q - start, axis=1)).max(axis=2) <= JUMP + pace
        return q, on_path

    def coordinates(
        self, which: np.ndarray, q: Float[np.ndarray, "motions time dof"]
    ) -> Float[np.ndarray, "motions time redundancy"]:
        """Return the coordinates y of motions around bases ``which``."""
        return np.einsum("ptdr,ptd->ptr", self.normal[which], q - self.base[which])


def charts(task: MotionTask, base: Float[np.ndarray, "bases time dof"]) -> Charts:
    """Return coordinates around base motions on the path."""
    count, times, dof = base.shape
    targets = np.tile(task.targets, (count, 1))
    slopes = task_errors(task.arm, task.tasks, base.reshape(-1, dof), targets)[1]
    jacobian = np.moveaxis(slopes, -1, 0).reshape(count, times, task.rows, dof)
    normal = np.linalg.svd(jacobian)[2][..., task.rows :, :].swapaxes(-1, -2)
    for i in range(1, times):  # parallel transport: each basis turned as near as can be to the one before
        left, _, right = np.linalg.svd(np.swapaxes(normal[:, i], -1, -2) @ normal[:, i - 1])
        normal[:, i] = normal[:, i] @ (left @ right)
    if task.cyclic:
        normal = _unwound(normal, task.times / task.times[-1])
    return Charts(base=base, normal=normal, steep=steepest(slopes).reshape(count, times, dof, task.rows))


def _unwound(normal: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Turn each basis evenly along the way so that it closes with the motion."""
    from scipy.linalg import expm, logm  # here: only cyclic motions need it

    closed = normal.copy()
    for b, basis in enumerate(normal):
        turn = np.real(logm(basis[-1].T @ basis[0]))
        closed[b] = basis @ np.stack([expm(part * (turn - turn.T) / 2) for part in share])
    closed[:, -1] = closed[:, 0]
    return closed

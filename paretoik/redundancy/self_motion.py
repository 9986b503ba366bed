"""Where else the arm could be while its tasks hold: postures, whole motions, and coordinates around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from paretoik.errors import Infeasible, OutOfReach
from paretoik.task.motion import steepest
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import ACCEPTED, retract, task_errors

ATTEMPTS = 40  # Newton steps of a cold start
JUMP = 0.7  # rad or m: no joint of a candidate moves further than this from one sample to the next


def postures(
    task: MotionTask, count: int, rng: np.random.Generator, *, sample: int = 0
) -> Float[np.ndarray, "found dof"]:
    """Return up to ``count`` postures that reach a sample, from random starts all over the joint ranges.

    Damped least squares (Nakamura & Hanafusa 1986), then Newton; those that don't arrive are left out.
    """
    q, left = _cold_start(task, count, rng, sample)
    return q[left <= ACCEPTED]


def _cold_start(
    task: MotionTask, count: int, rng: np.random.Generator, sample: int
) -> tuple[Float[np.ndarray, "count dof"], Float[np.ndarray, " count"]]:
    lower, upper = _range(task)
    q = rng.uniform(lower, upper, size=(count, task.arm.dof))
    targets = np.tile(task.targets[sample], (count, 1))
    for step in range(ATTEMPTS):
        error, slopes = task_errors(task.arm, task.tasks, q, targets)
        jacobian, gap = np.moveaxis(slopes, -1, 0), error.T[..., None]
        damping = 1e-2 * np.sum(gap**2, axis=1, keepdims=True) + (1e-3 if step < 5 else 1e-12)
        square = jacobian @ np.swapaxes(jacobian, -1, -2) + damping * np.eye(task.rows)
        move = (np.swapaxes(jacobian, -1, -2) @ np.linalg.solve(square, gap))[..., 0]
        q = q + move / np.maximum(1.0, np.abs(move).max(axis=1, keepdims=True) / 0.5)
    turning = task.arm.periodic & ~np.isfinite(task.arm.position_limits).all(axis=1)
    q[:, turning] = (q[:, turning] + np.pi) % (2 * np.pi) - np.pi
    return q, np.abs(task_errors(task.arm, task.tasks, q, targets)[0]).max(axis=0)


def _range(task: MotionTask) -> tuple[np.ndarray, np.ndarray]:
    lower, upper = task.arm.position_limits.T
    reach = np.where(task.arm.periodic, np.pi, 1.0)
    return np.where(np.isfinite(lower), lower, -reach), np.where(np.isfinite(upper), upper, reach)


def candidates(task: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "found time dof"]:
    """Return up to ``count`` motions on the path, by roll-outs of weighted pseudoinverses.

    Each starts at another posture (or all at the given one) and weighs the joints by its own random symmetric matrix
    with eigenvalues in (0, 1); every step is corrected onto the path. Source: Tringali & Cocuzza 2020, section 3.1.2.

    Raises OutOfReach, naming the sample, where no posture reaches the path; Infeasible where postures exist everywhere
    but no continuous motion was found.
    """
    start = postures(task, count, rng) if task.start is None else np.tile(task.start, (count, 1))
    if len(start) == 0:
        raise unreachable(task, rng, 0)
    q = _roll_outs(task, start, rng)
    if task.cyclic:
        q = _closed(task, q)
    q, on_path = _onto(task, q)
    if not on_path.all(axis=1).any():
        raise unreachable(task, rng, int(np.argmin(on_path, axis=1).max()))
    smooth = np.abs(np.diff(q, axis=1)).max(axis=(1, 2)) <= JUMP
    ...
    return q[kept]


def _roll_outs(
    task: MotionTask, start: Float[np.ndarray, "count dof"], rng: np.random.Generator
) -> Float[np.ndarray, "found time dof"]:
    """Return motions near the path: one Newton step a sample, each making good what the one before left."""
    inverses = _inverse_weights(len(start), task.arm.dof, rng)
    q = np.empty((len(start), len(task.times), task.arm.dof))
    q[:, 0] = start
    alive = np.ones(len(start), dtype=bool)
    for i in range(1, len(task.times)):
        here = q[alive, i - 1]
        error, slopes = task_errors(task.arm, task.tasks, here, np.tile(task.targets[i], (len(here), 1)))
        jacobian = np.moveaxis(slopes, -1, 0)
        spread = inverses[alive] @ np.swapaxes(jacobian, -1, -2)
        with np.errstate(all="ignore"):  # at a singularity steps grow without bound, and the jump ends the roll-out
            share = eliminate(np.moveaxis(jacobian @ spread, 0, -1), error)[0]
            move = (spread @ np.stack(share, axis=-1)[..., None])[..., 0]
        q[alive, i] = here + move
        alive[alive] = np.abs(move).max(axis=1) <= JUMP
        if not alive.any():
            raise unreachable(task, rng, i)
    return q[alive]


def unreachable(task: MotionTask, rng: np.random.Generator, near: int) -> OutOfReach | Infeasible:
    """Return the error that says why no motion gets past sample ``near``."""
    order = [near, *range(len(task.times))]
    for sample in order:
        q, left = _cold_start(task, 64, rng, sample)
        best = int(np.argmin(left))
        if left[best] > ACCEPTED:
            error = task_errors(task.arm, task.tasks, q[best : best + 1], task.targets[sample : sample + 1])[0][:, 0]
            size = min(3 if (task.tasks[0].axes or "").startswith("xyz") or task.tasks[0].axes == "pose" else 2, 3)
            wanted = task.targets[sample, :size]
            return OutOfReach(
                f"path leaves reach at sample {sample} ({task.times[sample]:.3g} s): {np.round(wanted, 6).tolist()} m "
                f"is "
                f"{np.linalg.norm(error[:size]):.3g} m from the nearest point found, "
                f"{np.round(wanted - error[:size], 6).tolist()} m",
                sample=sample,
            )
    jacobian = np.moveaxis(task_errors(task.arm, task.tasks, q, np.tile(task.targets[near], (len(q), 1)))[1], -1, 0)
    condition = float(np.linalg.cond(jacobian).min())
    return Infeasible(
        f"every sample can be reached, but no continuous motion passes sample {near} ({task.times[near]:.3g} s): a "
        f"singularity or a gap between branches (least condition number of the Jacobian there: {condition:.3g})"
    )


def _onto(task: MotionTask, q: np.ndarray, sample: int) -> np.ndarray:
    targets = np.tile(task.targets[sample], (len(q), 1))
    directions = steepest(task_errors(task.arm, task.tasks, q, targets)[1])
    return retract(task.arm, task.tasks, q, targets, directions).q


def _inverse_weights(count: int, dof: int, rng: np.random.Generator) -> Float[np.ndarray, "count dof dof"]:
    basis = np.linalg.qr(rng.normal(size=(count, dof, dof)))[0]
    eigenvalues = rng.uniform(0.02, 1.0, size=(count, dof))
    return (basis / eigenvalues[:, None, :]) @ np.swapaxes(basis, -1, -2)


def _closed(task: MotionTask, q: np.ndarray) -> np.ndarray:
    """Return those motions that still follow the path when their drift is taken out evenly, closed to the bit."""
    drift = q[:, -1:] - q[:, :1]
    drift = np.where(task.arm.periodic, (drift + np.pi) % (2 * np.pi) - np.pi, drift)
    share = (task.times / task.times[-1])[None, :, None]
    bent = (q - share * (q[:, -1:] - q[:, :1])) if not task.arm.periodic.any() else q - share * drift
    flat = bent.reshape(-1, task.arm.dof)
    targets = np.tile(task.targets, (len(q), 1))
    directions = steepest(task_errors(task.arm, task.tasks, flat, targets)[1])
    back = retract(task.arm, task.tasks, flat, targets, directions)
    closed = back.q.reshape(q.shape)
    closed[:, -1] = closed[:, 0]
    kept = back.on_path.reshape(q.shape[:2]).all(axis=1) & (np.abs(np.diff(closed, axis=1)).max(axis=(1, 2)) <= JUMP)
    if not kept.any():
        raise Infeasible("no cyclic motion was found: every candidate that follows the path ends in another posture")
    return closed[kept]


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
        """Return motions at coordinates y around bases ``which``, and which of their samples are on the path."""
        start = self.base[which] + np.einsum("ptdr,ptr->ptd", self.normal[which], y)
        count = len(which)
        found = retract(
            task.arm,
            task.tasks,
            start.reshape(-1, task.arm.dof),
            np.tile(task.targets, (count, 1)),
            self.steep[which].reshape(-1, task.arm.dof, task.rows),
        )
        return found.q.reshape(start.shape), found.on_path.reshape(start.shape[:2])

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

"""Least kinetic energy by the calculus of variations: motions along which ∫ ½ q̇ᵀ M q̇ dt is stationary.

Under the path's constraint J q̇ = ẋ the Euler–Lagrange equation is M q̈ + n = Jᵀλ, with n(q, q̇) the Coriolis and
centrifugal torques: no torque drives the self-motion. Without λ: q̈ = J_B⁺(ẍ − J̇q̇) − (I − J_B⁺J) M⁻¹n, J_B⁺ weighted
by the inertia. Tringali & Cocuzza 2020, Eq. 20, has the opposite sign, along which nothing is stationary. Where an
end is free, no momentum is left in the self-motion (transversality), which is q̇ = J_B⁺ẋ.

Source: Nedungadi & Kazerounian 1989, A local solution with global characteristics for the joint torque optimization
of a redundant manipulator; Gelfand & Fomin 1963, Calculus of Variations, chapter 5 (Jacobi's condition).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.integrate import RK45
from scipy.interpolate import CubicSpline

from paretoik.arrays import JointPaths
from paretoik.errors import Infeasible, InvalidInput
from paretoik.resolution.law_of_motion import Law, law_of_motion
from paretoik.robot import dynamics
from paretoik.self_motion.charts import build_charts
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.motion_task_validation import START_TOLERANCE
from paretoik.task.retraction import retract, row_space_basis, task_errors

TOLERANCE = 1e-8  # of positions and velocities (relative past 1), each step
FINEST, COARSEST = 1e-13, 1e-3  # tolerances that mean something
FIRST, SHORTEST = 1e-2, 1e-5  # steps, as shares of the duration; shorter ones are those of a motion into a singularity
NEARBY = 1e-4  # rad or m: of the differences that Newton's method takes
FLAT = 1e-4  # share of the steepest slope: differences cannot tell less from nothing
STRIDE, SHORTEST_STRIDE = 0.2, 1e-3  # rad or m: steps of Newton's method along the self-motion
ITERATIONS = 20
AT_REST = 1e3  # times the tolerance: rad/s or m/s of self-motion at a free end
APART = 1e-4  # rad or m: motions whose starts are nearer are one


@dataclass(frozen=True, kw_only=True, eq=False)
class Extremal:
    """Motions of stationary kinetic energy, and their velocities, which ``motion.dq`` only approximates.

    ``minimum`` says which satisfy Jacobi's condition, and are therefore local minima; None where nobody looked.
    """

    motion: Motion
    dq: JointPaths
    minimum: Bool[np.ndarray, "*batch"] | None = None

    @property
    def energy(self) -> Float[np.ndarray, "*batch"]:
        """∫ ½ q̇ᵀ M q̇ dt [J s] of the motion in continuous time, by a cubic spline through its samples."""
        power = dynamics.kinetic_energy(self.motion.arm, self.motion.q, self.dq)
        times = self.motion.tasks[0].path.times
        whole: np.ndarray = np.asarray(CubicSpline(times, power, axis=-1).integrate(times[0], times[-1]))
        return whole


def variational(
    task: MotionTask,
    start: Float[np.ndarray, "*batch dof"] | None = None,
    *,
    rates: Float[np.ndarray, "*batch dof"] | None = None,
    tolerance: float = TOLERANCE,
    as_printed: bool = False,
) -> Extremal:
    """Return the motions of stationary kinetic energy that leave postures on the path's first sample.

    Parameters
    ----------
    task
        An open motion task of an arm with masses; its objectives and limits are not looked at.
    start
        Postures (*batch, dof) at sample 0; by default the task's own start.
    rates
        Joint velocities (*batch, dof) there; by default those of least kinetic energy, as free starts want them.
    tolerance
        Of every integration step, by Dormand & Prince's fifth-order pair; each motion has its own steps.
    as_printed
        Whether to take the sign of Eq. 20 as printed, to see what it does.

    Raises
    ------
    InvalidInput
        For a cyclic task, a massless arm, starts off the path, or rates that don't follow it.
    Infeasible
        Where a motion ends in a singularity, with sample and time.
    """
    law = _asked(task, tolerance, as_printed=as_printed)
    q = _starts(task, start)
    flat = q.reshape(-1, task.arm.dof)
    dq = law.least_rates(flat) if rates is None else _given_rates(law, flat, q.shape, rates)
    return _followed(law, flat, dq, tolerance, q.shape[:-1])


def shooting(task: MotionTask, starts: Float[np.ndarray, "*batch dof"], *, tolerance: float = TOLERANCE) -> Extremal:
    """Return the distinct motions of stationary kinetic energy with both ends free, by Newton's method from postures.

    What is sought is the posture at sample 0 from which no momentum is left in the self-motion at the end. The motions
    (found, time, dof) come least energy first; ``minimum`` says which are local minima, the others being saddles.
    Starts whose motions meet a singularity, or from which Newton's method goes nowhere, are left out.

    Raises InvalidInput as ``variational`` does and for a task with a start of its own, Infeasible where none is found.
    """
    if task.start is not None:
        raise InvalidInput("shooting: wants a free start, but the task has a start of its own; variational takes it")
    law = _asked(task, tolerance, as_printed=False)
    q = _transversal(law, _starts(task, starts).reshape(-1, task.arm.dof), tolerance)
    if len(q) == 0:
        raise Infeasible("shooting: no start led to a motion that leaves no momentum in the self-motion at its end")
    found = _followed(law, q, law.least_rates(q), tolerance, q.shape[:1])
    kept = np.array(_distinct(task, q, found.energy))
    motion, dq = found.motion[kept], found.dq[kept]
    return Extremal(motion=motion, dq=dq, minimum=_is_minimum(law, motion.q, tolerance))


def _asked(task: MotionTask, tolerance: float, *, as_printed: bool) -> Law:
    if not FINEST <= tolerance <= COARSEST:
        raise InvalidInput(f"variational: tolerance must be {FINEST:g} to {COARSEST:g}, got {tolerance:g}")
    return law_of_motion(task, as_printed=as_printed)


def _integrated(law: Law, start: np.ndarray, times: np.ndarray, tolerance: float) -> np.ndarray:
    """Return states (motions, time, 2 dof), NaN from where on a motion gets no further."""
    states = np.full((len(start), len(times), start.shape[1]), np.nan)
    duration = times[-1] - times[0]
    t, y, pace = np.full(len(start), times[0]), start.copy(), np.full(len(start), FIRST * duration)
    with np.errstate(all="ignore"):  # towards a singularity numbers overflow, and shorter steps are tried
        slope = law(t, y)
        for sample, until in enumerate(times):
            while len(going := np.flatnonzero((t < until) & (pace > SHORTEST * duration))):
                left = until - t[going]
                step = np.minimum(pace[going], left)
                trial, last, error = _step(law, t[going], y[going], slope[going], step, tolerance)
                good, whole = error <= 1, step == left
                next_pace = step * np.clip(0.9 * np.maximum(error, 1e-10) ** -0.2, 0.2, 5.0)
                pace[going] = np.where(good & whole, np.maximum(pace[going], next_pace), next_pace)
                won = going[good]
                t[won] = np.where(whole, until, t[going] + step)[good]
                y[won], slope[won] = trial[good], last[good]
            there = t >= until
            states[there, sample] = y[there]
    return states


def _step(
    law: Law, t: np.ndarray, y: np.ndarray, slope: np.ndarray, step: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (state, its rate, error over what is tolerated) after one step each. Source: Dormand & Prince 1980."""
    stages, wide = [slope], step[:, None]
    for row, share in zip(RK45.A[1:], RK45.C[1:], strict=True):
        change = np.tensordot(row[: len(stages)], np.stack(stages), axes=1)
        stages.append(law(t + share * step, y + wide * change))
    trial = y + wide * np.tensordot(RK45.B, np.stack(stages), axes=1)
    stages.append(law(t + step, trial))
    error = np.abs(wide * np.tensordot(RK45.E, np.stack(stages), axes=1))
    allowed = tolerance * np.maximum(1.0, np.maximum(np.abs(y), np.abs(trial)))
    worst = np.max(error / allowed, axis=1)
    return trial, stages[-1], np.where(np.isfinite(worst), worst, np.inf)


def _followed(law: Law, q: np.ndarray, dq: np.ndarray, tolerance: float, batch: tuple[int, ...]) -> Extremal:
    """Return the motions from postures and velocities (motions, dof), led back onto the path sample by sample."""
    task, count = law.task, len(q)
    states = _integrated(law, np.concatenate([q, dq], axis=1), task.times, tolerance)
    near, rates = (part.reshape(-1, task.arm.dof) for part in np.split(states, 2, axis=2))
    with np.errstate(invalid="ignore"):
        found = _shifted(task, near, np.tile(task.targets, (count, 1)))
    _check_complete(task, found.reshape(count, -1, task.arm.dof))
    rates = law.led(np.tile(task.times, count), found, rates)
    shape = (*batch, len(task.times), task.arm.dof)
    return Extremal(motion=task.motion(found.reshape(shape)), dq=rates.reshape(shape))


def _check_complete(task: MotionTask, q: Float[np.ndarray, "motions time dof"]) -> None:
    complete = np.isfinite(q).all(axis=2)
    if complete.all():
        return
    motion = int(np.argmin(complete.all(axis=1)))
    sample = max(0, int(np.argmin(complete[motion])) - 1)
    where = f"motion {motion} runs into a singularity past sample {sample} ({task.times[sample]:.3g} s)"
    slopes = task_errors(task.arm, task.tasks, q[motion, [sample]], task.targets[[sample]])[1][..., 0]
    condition = f"{np.linalg.cond(slopes):.3g}" if np.isfinite(slopes).all() else "infinite"
    raise Infeasible(f"variational: {where}, where the Jacobian's condition number is {condition}")


def _shifted(task: MotionTask, q: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Return postures near the path led onto it the shortest way; those that don't arrive are NaN."""
    slopes = task_errors(task.arm, task.tasks, q, targets)[1]
    found = retract(task.arm, task.tasks, q, targets, row_space_basis(slopes))
    return np.where(found.on_path[:, None], found.q, np.nan)


def _starts(task: MotionTask, start: np.ndarray | None) -> np.ndarray:
    """Return postures (*batch, dof) on the path's first sample; raise InvalidInput where they were not."""
    given = task.start if start is None else np.asarray(start, dtype=float)
    if given is None:
        raise InvalidInput("variational: wants start postures, the task has no start of its own")
    if given.ndim == 0 or given.shape[-1] != task.arm.dof or not np.isfinite(given).all():
        raise InvalidInput(f"variational: start wants finite postures (..., {task.arm.dof}), got shape {given.shape}")
    flat = given.reshape(-1, task.arm.dof)
    targets = np.tile(task.targets[0], (len(flat), 1))
    distance = np.abs(task_errors(task.arm, task.tasks, flat, targets)[0]).max(axis=0, initial=0.0)
    if (distance > START_TOLERANCE).any():
        worst = int(np.argmax(distance))
        raise InvalidInput(
            f"variational: start {worst} is {distance[worst]:.3g} m (or rad) off the path's first sample; wants at "
            f"most {START_TOLERANCE}"
        )
    led = _shifted(task, flat, targets)
    return np.where(np.isfinite(led), led, flat).reshape(given.shape)


def _given_rates(law: Law, q: np.ndarray, shape: tuple[int, ...], rates: np.ndarray) -> np.ndarray:
    """Return velocities (motions, dof) that follow the path; raise InvalidInput where the given ones didn't."""
    given = np.asarray(rates, dtype=float)
    if given.shape != shape or not np.isfinite(given).all():
        raise InvalidInput(f"variational: rates want finite numbers of the starts' shape {shape}, got {given.shape}")
    flat = given.reshape(q.shape)
    at = law.at(np.zeros(len(q)), q, flat)
    apart = np.abs((at.jacobian @ flat[..., None])[..., 0] - at.speed).max(initial=0.0)
    if apart > START_TOLERANCE:
        raise InvalidInput(f"variational: rates must follow the path, but lead {apart:.3g} m/s (or rad/s) away from it")
    return flat


def _transversal(law: Law, q: np.ndarray, tolerance: float) -> np.ndarray:
    """Return postures (found, dof) at sample 0 from which motions with free starts end with nothing left."""
    targets, dof = law.task.targets[0], q.shape[1]
    best, step = np.full(len(q), np.inf), np.zeros_like(q)
    arrived = []
    for _ in range(ITERATIONS):
        trial = _shifted(law.task, q + step, np.tile(targets, (len(q), 1)))
        trial = np.where(np.isfinite(trial), trial, q)
        near = _neighbours(law.task, trial, normal := _normal(law.task, trial))
        left = _left_over(law, near.reshape(-1, dof), tolerance).reshape(near.shape)
        size = np.abs(left[:, 0]).max(axis=1)
        arrived.append(trial[size <= AT_REST * tolerance])
        better = (size < best) & np.isfinite(left).all(axis=(1, 2))
        slopes = np.swapaxes(left[better, 1:] - left[better, :1], 1, 2) / NEARBY
        step /= 4  # where it has led nowhere better
        step[better] = -(normal[better] @ np.linalg.pinv(slopes, rcond=FLAT) @ left[better, 0, :, None])[..., 0]
        step /= np.maximum(1.0, np.linalg.norm(step, axis=1, keepdims=True) / STRIDE)
        q, best = np.where(better[:, None], trial, q), np.where(better, size, best)
        going = (best > AT_REST * tolerance) & (better | (np.abs(step).max(axis=1) > SHORTEST_STRIDE))
        q, best, step = q[going], best[going], step[going]
        if len(q) == 0:
            break
    return np.concatenate(arrived)


def _left_over(law: Law, q: np.ndarray, tolerance: float) -> np.ndarray:
    """Return the self-motion velocity (motions, dof) that motions from postures end with; NaN where they don't."""
    times = law.task.times[[0, -1]]
    states = _integrated(law, np.concatenate([q, law.least_rates(q)], axis=1), times, tolerance)
    return _self_motion(law, states[:, -1])


def _self_motion(law: Law, last: np.ndarray) -> np.ndarray:
    """Return what final states (motions, 2 dof) have in velocity beyond the least that the path asks for."""
    q, dq = np.split(last, 2, axis=1)
    with np.errstate(invalid="ignore"):
        least = law.led(np.full(len(q), law.task.times[-1]), q, np.zeros_like(dq))
    return dq - least


def _normal(task: MotionTask, q: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (motions, dof, redundancy) of the self-motion at sample 0."""
    slopes = task_errors(task.arm, task.tasks, q, np.tile(task.targets[0], (len(q), 1)))[1]
    basis: np.ndarray = np.linalg.svd(np.moveaxis(slopes, -1, 0))[2][:, task.rows :].swapaxes(1, 2)
    return basis


def _neighbours(task: MotionTask, q: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return postures (motions, 1 + redundancy, dof): each itself, and moved along every direction of ``normal``."""
    near = q[:, None] + NEARBY * np.concatenate([np.zeros_like(q)[:, None], np.swapaxes(normal, 1, 2)], axis=1)
    flat = near.reshape(-1, task.arm.dof)
    return _shifted(task, flat, np.tile(task.targets[0], (len(flat), 1))).reshape(near.shape)


def _distinct(task: MotionTask, q: np.ndarray, energy: np.ndarray) -> list[int]:
    """Return which postures to keep, least energy first: of those that are one, modulo whole turns, the first."""
    kept: list[int] = []
    for i in np.argsort(energy, kind="stable").tolist():
        away = q[kept] - q[i]
        away = np.where(task.arm.periodic, (away + np.pi) % (2 * np.pi) - np.pi, away)
        if not (np.abs(away).max(axis=1, initial=0.0) < APART).any():
            kept.append(i)
    return kept


def _is_minimum(law: Law, q: Float[np.ndarray, "motions time dof"], tolerance: float) -> Bool[np.ndarray, " motions"]:
    """Return which motions satisfy Jacobi's condition, their neighbours with free starts beside them.

    The neighbours must not meet a motion before its end, and must arrive there with momentum away from it.
    """
    task, (count, samples, dof) = law.task, q.shape
    normal = build_charts(task, q).null_space
    near = _neighbours(task, q[:, 0], normal[:, 0]).reshape(-1, dof)
    states = _integrated(law, np.concatenate([near, law.least_rates(near)], axis=1), task.times, tolerance)
    paths = states[..., :dof].reshape(count, -1, samples, dof)
    left = _self_motion(law, states[:, -1]).reshape(count, -1, dof)
    fan = np.einsum("mtdk,mrtd->mtkr", normal, paths[:, 1:] - paths[:, :1]) / NEARBY
    gained = np.swapaxes(left[:, 1:] - left[:, :1], 1, 2) / NEARBY
    inertia = dynamics.inertia_matrix(task.arm, q[:, -1])
    bend = np.swapaxes(normal[:, -1] @ fan[:, -1], 1, 2) @ inertia @ gained
    clear = (np.linalg.det(fan) > 0).all(axis=1)
    upward: np.ndarray = np.linalg.eigvalsh(np.nan_to_num(bend + np.swapaxes(bend, 1, 2))).min(axis=1) > 0
    return clear & upward

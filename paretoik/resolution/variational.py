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
from scipy.interpolate import CubicSpline

from paretoik.arrays import JointPaths
from paretoik.errors import Infeasible, InvalidInput
from paretoik.resolution.equation_of_motion import EquationOfMotion, equation_of_motion
from paretoik.resolution.integration import integrate
from paretoik.robot import dynamics
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.motion_task_validation import START_TOLERANCE
from paretoik.task.retraction import retract, row_space_basis, task_errors

STEP_TOLERANCE = 1e-8  # of positions and velocities (relative past 1), each step


@dataclass(frozen=True, kw_only=True, eq=False)
class Extremal:
    """Motions of stationary kinetic energy, and their velocities, which ``motion.dq`` only approximates.

    ``minimum`` says which satisfy Jacobi's condition, and are therefore local minima; None where it was not tested.
    """

    motion: Motion
    dq: JointPaths
    minimum: Bool[np.ndarray, "*batch"] | None = None

    @property
    def energy(self) -> Float[np.ndarray, "*batch"]:
        """∫ ½ q̇ᵀ M q̇ dt [J s] of the motion in continuous time, by a cubic spline through its samples."""
        power = dynamics.kinetic_energy(self.motion.arm, self.motion.q, self.dq)
        times = self.motion.tasks[0].path.times
        return np.asarray(CubicSpline(times, power, axis=-1).integrate(times[0], times[-1]))


def integrate_extremal(
    task: MotionTask,
    start: Float[np.ndarray, "*batch dof"] | None = None,
    *,
    rates: Float[np.ndarray, "*batch dof"] | None = None,
    tolerance: float = STEP_TOLERANCE,
    as_printed: bool = False,
) -> Extremal:
    """Return the motions of stationary kinetic energy that leave postures on the path's first sample.

    Parameters
    ----------
    task
        An open motion task of an arm with masses; its objectives and limits do not count.
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
    check_tolerance(tolerance)
    equation = equation_of_motion(task, as_printed=as_printed)
    q = starts_on_path(task, start)
    flat = q.reshape(-1, task.arm.dof)
    dq = equation.initial_rates(flat) if rates is None else _checked_rates(equation, flat, q.shape, rates)
    return follow_equation(equation, flat, dq, tolerance, q.shape[:-1])


def extremal_paths(
    task: MotionTask, start: Float[np.ndarray, "motions dof"], *, tolerance: Float[np.ndarray, " motions"]
) -> tuple[Float[np.ndarray, "motions time dof"], Float[np.ndarray, "motions time dof"]]:
    """Return positions and velocities of ``integrate_extremal``, NaN from where a motion runs into a singularity.

    Raises InvalidInput for a cyclic task, a massless arm, starts off the path and tolerances out of range.
    """
    check_tolerance(tolerance)
    equation = equation_of_motion(task)
    q = starts_on_path(task, start)
    return _paths(equation, q, equation.initial_rates(q), tolerance)


def follow_equation(
    equation: EquationOfMotion, q: np.ndarray, dq: np.ndarray, tolerance: float, shape: tuple[int, ...]
) -> Extremal:
    """Return the motions from postures and velocities (motions, dof); raise Infeasible where one is incomplete."""
    task = equation.task
    paths, rates = _paths(equation, q, dq, tolerance)
    _check_complete(task, paths)
    whole = (*shape, len(task.times), task.arm.dof)
    return Extremal(motion=task.motion(paths.reshape(whole)), dq=rates.reshape(whole))


def retract_nearest(task: MotionTask, q: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Return postures near the path retracted onto it the shortest way; those that don't arrive are NaN."""
    jacobians = task_errors(task.arm, task.tasks, q, targets)[1]
    result = retract(task.arm, task.tasks, q, targets, row_space_basis(jacobians))
    return np.where(result.on_path[:, None], result.q, np.nan)


def check_tolerance(tolerance: float | np.ndarray) -> None:
    """Raise InvalidInput for a tolerance out of range."""
    lowest, highest = 1e-13, 1e-3  # finer ones are below rounding, coarser ones leave the path
    for value in np.ravel(tolerance):
        if not lowest <= value <= highest:
            raise InvalidInput(f"variational: tolerance must be {lowest:g} to {highest:g}, got {value:g}")


def starts_on_path(task: MotionTask, start: np.ndarray | None) -> np.ndarray:
    """Return postures (*batch, dof) on the path's first sample; raise InvalidInput where they are not."""
    q = task.start if start is None else np.asarray(start, dtype=float)
    if q is None:
        raise InvalidInput("variational: wants start postures, the task has no start of its own")
    if q.ndim == 0 or q.shape[-1] != task.arm.dof or not np.isfinite(q).all():
        raise InvalidInput(f"variational: start wants finite postures (..., {task.arm.dof}), got shape {q.shape}")
    flat = q.reshape(-1, task.arm.dof)
    targets = np.tile(task.targets[0], (len(flat), 1))
    distance = np.abs(task_errors(task.arm, task.tasks, flat, targets)[0]).max(axis=0, initial=0.0)
    if (distance > START_TOLERANCE).any():
        worst = int(np.argmax(distance))
        raise InvalidInput(
            f"variational: start {worst} is {distance[worst]:.3g} m (or rad) off the path's first sample; wants at "
            f"most {START_TOLERANCE}"
        )
    retracted = retract_nearest(task, flat, targets)
    return np.where(np.isfinite(retracted), retracted, flat).reshape(q.shape)


def _paths(
    equation: EquationOfMotion, q: np.ndarray, dq: np.ndarray, tolerance: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities (motions, time, dof), retracted onto the path sample by sample."""
    task, count = equation.task, len(q)
    states = integrate(equation, np.concatenate([q, dq], axis=1), task.times, tolerance)
    near, rates = (part.reshape(-1, task.arm.dof) for part in np.split(states, 2, axis=2))
    with np.errstate(invalid="ignore"):
        paths = retract_nearest(task, near, np.tile(task.targets, (count, 1)))
    return paths.reshape(count, -1, task.arm.dof), _project_rates(equation, paths, rates, count)


def _project_rates(equation: EquationOfMotion, paths: np.ndarray, rates: np.ndarray, count: int) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        projected = equation.project(np.tile(equation.task.times, count), paths, rates)
    return projected.reshape(count, -1, paths.shape[1])


def _check_complete(task: MotionTask, q: Float[np.ndarray, "motions time dof"]) -> None:
    complete = np.isfinite(q).all(axis=2)
    if complete.all():
        return
    motion = int(np.argmin(complete.all(axis=1)))
    sample = max(0, int(np.argmin(complete[motion])) - 1)
    where = f"motion {motion} runs into a singularity past sample {sample} ({task.times[sample]:.3g} s)"
    jacobian = task_errors(task.arm, task.tasks, q[motion, [sample]], task.targets[[sample]])[1][..., 0]
    condition = f"{np.linalg.cond(jacobian):.3g}" if np.isfinite(jacobian).all() else "infinite"
    raise Infeasible(f"variational: {where}, where the Jacobian's condition number is {condition}")


def _checked_rates(equation: EquationOfMotion, q: np.ndarray, shape: tuple[int, ...], rates: np.ndarray) -> np.ndarray:
    """Return velocities (motions, dof) that follow the path; raise InvalidInput where they don't."""
    dq = np.asarray(rates, dtype=float)
    if dq.shape != shape or not np.isfinite(dq).all():
        raise InvalidInput(f"variational: rates want finite numbers of the starts' shape {shape}, got {dq.shape}")
    flat = dq.reshape(q.shape)
    terms = equation.terms(np.zeros(len(q)), q, flat)
    residual = np.abs((terms.jacobian @ flat[..., None])[..., 0] - terms.velocity).max(initial=0.0)
    if residual > START_TOLERANCE:
        raise InvalidInput(
            f"variational: rates must follow the path, but lead {residual:.3g} m/s (or rad/s) away from it"
        )
    return flat

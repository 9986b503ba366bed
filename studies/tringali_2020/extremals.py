"""Motions of stationary kinetic energy from given postures, with the equation of motion right or as printed.

Source: Tringali & Cocuzza 2020, Eq. 20.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from paretoik.arrays import JointPaths
from paretoik.errors import Infeasible, InvalidInput
from paretoik.resolution.variational import (
    EquationOfMotion,
    check_tolerance,
    equation_of_motion,
    integrate_paths,
    starts_on_path,
)
from paretoik.robot import dynamics
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import task_errors
from paretoik.task.validation import START_TOLERANCE


@dataclass(frozen=True, kw_only=True, eq=False)
class Extremal:
    """Motions of stationary kinetic energy, and their velocities, which ``motion.dq`` only approximates."""

    motion: Motion
    dq: JointPaths

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
    tolerance: float = 1e-8,
    as_printed: bool = False,
) -> Extremal:
    """Return the motions of stationary kinetic energy that leave postures on the first sample of an open motion task.

    ``start`` are postures (*batch, dof), the task's own by default; ``rates`` velocities there, by default those of
    least kinetic energy. Every step of Dormand & Prince's fifth-order pair has the ``tolerance``. ``as_printed`` takes
    the sign of Eq. 20 as printed. Raises InvalidInput for a cyclic task, a massless arm, starts off the path, or rates
    that don't follow it; Infeasible if a motion ends in a singularity, with sample and time.
    """
    check_tolerance(tolerance)
    equation = equation_of_motion(task)
    equation = replace(equation, sign=-equation.sign) if as_printed else equation
    q = starts_on_path(task, start)
    flat = q.reshape(-1, task.arm.dof)
    dq = equation.initial_rates(flat) if rates is None else _rates_along_path(equation, flat, q.shape, rates)
    paths, velocities = integrate_paths(equation, flat, dq, tolerance)
    complete = np.isfinite(paths).all(axis=2)
    if not complete.all():
        number = int(np.argmin(complete.all(axis=1)))
        sample = max(0, int(np.argmin(complete[number])) - 1)
        where = f"motion {number} runs into a singularity past sample {sample} ({task.times[sample]:.3g} s)"
        jacobian = task_errors(task.arm, task.tasks, paths[number, sample], task.targets[sample])[1]
        condition = f"{np.linalg.cond(jacobian):.3g}" if np.isfinite(jacobian).all() else "infinite"
        raise Infeasible(f"variational: {where}, where the Jacobian's condition number is {condition}")
    whole = (*q.shape[:-1], len(task.times), task.arm.dof)
    return Extremal(motion=task.motion(paths.reshape(whole)), dq=velocities.reshape(whole))


def _rates_along_path(
    equation: EquationOfMotion, q: np.ndarray, shape: tuple[int, ...], rates: np.ndarray
) -> np.ndarray:
    """Return velocities (motions, dof) that follow the path; raise InvalidInput if they do not."""
    dq = np.asarray(rates, dtype=float)
    if dq.shape != shape or not np.isfinite(dq).all():
        raise InvalidInput(f"variational: rates must be finite numbers of the starts' shape {shape}, got {dq.shape}")
    flat = dq.reshape(q.shape)
    terms = equation.terms(np.zeros(len(q)), q, flat)
    residual = np.abs((terms.jacobian @ flat[..., None])[..., 0] - terms.velocity).max(initial=0.0)
    if residual > START_TOLERANCE:
        raise InvalidInput(
            f"variational: rates must follow the path, but lead {residual:.3g} m/s (or rad/s) away from it"
        )
    return flat

"""The equation of motion of least kinetic energy under a path; see ``variational``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.interpolate import make_interp_spline

from paretoik.autodiff.differentiation import gradient, tangents
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.operations import Op
from paretoik.autodiff.tape import Tape, as_entry
from paretoik.errors import InvalidInput
from paretoik.robot import dynamics
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import link_frames
from paretoik.task.motion_task import MotionTask

KNOTS = 2000  # of the splines that paths are differentiated by


@dataclass(frozen=True, kw_only=True, eq=False)
class Instant:
    """What holds at an instant: J, what J q̇ and J q̈ must be, the inertia matrix and the torques n(q, q̇)."""

    jacobian: Float[np.ndarray, "motions rows dof"]
    speed: Float[np.ndarray, "motions rows"]
    bend: Float[np.ndarray, "motions rows"]
    inertia: Float[np.ndarray, "motions dof dof"]
    torque: Float[np.ndarray, "motions dof"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Law:
    """M q̈ + n = Jᵀλ with J q̇ = ẋ; ``course`` holds the targets and their two derivatives in time.

    ``sign`` is that of n, −1 where it is right; ``known`` computes what an ``Instant`` holds.
    """

    task: MotionTask
    course: tuple[Any, Any, Any]
    sign: float
    known: Evaluator

    def __call__(self, t: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return the rates of states (motions, 2 dof): velocities and accelerations."""
        q, dq = np.split(state, 2, axis=1)
        at = self.at(t, q, dq)
        return np.concatenate([dq, _balanced(at, self.sign * at.torque, at.bend)], axis=1)

    def least_rates(self, q: np.ndarray) -> np.ndarray:
        """Return the velocities J_B⁺ẋ (motions, dof) of least kinetic energy at sample 0."""
        return self.led(np.zeros(len(q)), q, np.zeros_like(q))

    def led(self, t: np.ndarray, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """Return the velocities nearest to dq, in the metric of the inertia, that follow the path."""
        at = self.at(t, q, dq)
        return _balanced(at, (at.inertia @ dq[..., None])[..., 0], at.speed)

    def at(self, t: np.ndarray, q: np.ndarray, dq: np.ndarray) -> Instant:
        """Return what holds at times t (motions,), postures and velocities (motions, dof)."""
        rows, dof = self.task.rows, self.task.arm.dof
        found = self.known(np.concatenate([q, dq, *(part(t) for part in self.course)], axis=1).T).T
        ends = np.cumsum([rows * dof, rows, rows, dof * dof])
        jacobian, speed, bend, inertia, torque = np.split(found, ends, axis=1)
        return Instant(
            jacobian=jacobian.reshape(-1, rows, dof),
            speed=speed,
            bend=bend,
            inertia=inertia.reshape(-1, dof, dof),
            torque=torque,
        )


def law_of_motion(task: MotionTask, *, as_printed: bool) -> Law:
    """Return the equation of motion of a task; ``as_printed`` with the paper's sign.

    Raises InvalidInput for a cyclic task, and an arm with joints that move no mass.
    """
    if task.cyclic:
        raise InvalidInput("variational: wants an open motion, got a cyclic one")
    probe = dynamics.inertia_matrix(task.arm, np.full((1, task.arm.dof), 0.5))[0]
    least, most = np.linalg.eigvalsh(probe)[[0, -1]]
    if least <= 1e-12 * most:
        raise InvalidInput(f"variational: wants an arm whose every joint moves a mass, {task.arm.name} has others")
    parts = max(1, -(-KNOTS // (len(task.times) - 1)))
    knots = np.interp(np.arange(parts * (len(task.times) - 1) + 1) / parts, np.arange(len(task.times)), task.times)
    course = make_interp_spline(knots, np.concatenate([one.targets(knots) for one in task.tasks], axis=1), k=5)
    return Law(
        task=task,
        course=(course, course.derivative(), course.derivative(2)),
        sign=1.0 if as_printed else -1.0,
        known=_written(task, task.arm.mounted(gravity=(0.0, 0.0, 0.0))),
    )


def _written(task: MotionTask, arm: Arm) -> Evaluator:
    """Return the program of what an ``Instant`` holds, of q, q̇, and the targets with their two derivatives in time.

    Along the path the path equations h(q, x) = 0 stay what they are: J q̇ + ∂h/∂x ẋ = 0, and once more.
    """
    tape, dof, numbers = Tape(), arm.dof, task.targets.shape[1]
    parts: list[Any] = [[tape.input() for _ in range(count)] for count in (dof, dof, numbers, numbers, numbers)]
    q, dq, *course = parts
    links, equations, begun = link_frames(arm, q), list[int](), 0
    for one in task.tasks:
        wanted = course[0][begun : begun + one.target_size]
        equations += [as_entry(tape, value) for value in one.equations(arm, links, wanted)]
        begun += one.target_size
    joints, rates = ([value.index for value in values] for values in (q, dq))
    targets, moved, bent = ([value.index for value in values] for values in course)
    jacobian = [slope for equation in equations for slope in gradient(tape, equation, joints)]
    drawn = tangents(tape, equations, dict(zip(targets, moved, strict=True)))
    along = dict(zip([*joints, *targets], [*rates, *moved], strict=True))
    changed = tangents(tape, equations, along)
    twice = tangents(tape, changed, along | dict(zip(moved, bent, strict=True)))
    still, units = [0.0] * dof, np.eye(dof).tolist()
    inertia = [dynamics.torque_components(arm, q, still, unit) for unit in units]
    torque = dynamics.torque_components(arm, q, dq, still)
    forces = [as_entry(tape, value) for value in (*(value for column in inertia for value in column), *torque)]
    turned = [tape.apply(Op.NEGATE, value) for value in (*drawn, *twice)]
    return compile_evaluator(tape, [*jacobian, *turned, *forces])


def _balanced(at: Instant, force: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return x with J x = ``wanted`` and M x = ``force`` + Jᵀλ, which is J_B⁺ wanted + (I − J_B⁺J) M⁻¹ force."""
    rows, dof = at.jacobian.shape[1:]
    whole = np.zeros((len(wanted), dof + rows, dof + rows))
    whole[:, :dof, :dof], whole[:, dof:, :dof] = at.inertia, at.jacobian
    whole[:, :dof, dof:] = np.swapaxes(at.jacobian, 1, 2)
    whole[np.linalg.det(whole) == 0] = np.nan  # as at a singularity, where there is no x
    found: np.ndarray = np.linalg.solve(whole, np.concatenate([force, wanted], axis=1)[..., None])[:, :dof, 0]
    return found

"""The least of an objective over a few samples ahead, from a posture and its velocity: a small nonlinear program.

Variables are the joint positions q₁ ... q_h at the times ahead; rates are backward differences, those of the first
from what is given. It is solved by sequential quadratic programming in the null space of the path's equations, with
the exact Hessian of the Lagrangian, every step led back onto the path.

Source: Tringali & Cocuzza 2021, Eq. 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.differentiation import dependencies, gradient, hessian
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.autodiff.tracing import Trace
from paretoik.errors import InvalidInput
from paretoik.robot.kinematics import link_frames
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from paretoik.task.traced_motion import TracedMotion, trace_sample_function


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """The positions ahead, the objective there, and whether it is stationary on the path after so many iterations."""

    q: Float[np.ndarray, "ahead dof"]
    value: float
    converged: bool
    iterations: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Horizon:
    """The program of so many samples ahead, ``interval`` [s] apart.

    ``first`` gives, of positions ahead, position, velocity and targets, the objective, its gradient, the path's
    equations and their Jacobian, sample by sample; ``second``, of multipliers too, the Hessian of the Lagrangian at
    ``places``.
    """

    ahead: int
    dof: int
    rows: int
    interval: float
    first: Evaluator
    second: Evaluator
    places: tuple[np.ndarray, np.ndarray]

    def solved(
        self,
        q: Float[np.ndarray, "ahead dof"],
        posture: Float[np.ndarray, " dof"],
        velocity: Float[np.ndarray, " dof"],
        targets: Float[np.ndarray, "ahead numbers"],
    ) -> Found:
        """Return the minimum that positions ahead lead to."""
        rest = np.zeros(self.ahead * self.rows + self.dof)
        given = np.concatenate([q.ravel(), posture, velocity, targets.ravel(), rest])[:, None]
        value, converged, iterations = _compiled()(
            self.first.arrays, self.second.arrays, *self.places, given, self.ahead, self.dof, self.rows
        )
        return Found(q=given[: q.size].reshape(q.shape), value=value, converged=converged, iterations=iterations)


def horizon(task: MotionTask, objective: Objective, ahead: int, interval: float, terminal: float = 0.0) -> Horizon:
    """Write down the program of an objective over samples ahead; the last counts ``terminal`` times more.

    Raises InvalidInput, naming the objective, where it looks at more than one sample's positions, velocities and
    accelerations, or hangs on none of them.
    """
    n, what = task.arm.dof, f"objective {objective.name}"
    if objective.form != "integral":
        raise InvalidInput(f"{what}: form 'integral' wanted, got {objective.form!r}")
    trace = Trace(len(task.times))
    tape = trace.tape
    samples = [trace.inputs(n) for _ in range(ahead)]
    posture, velocity = trace.inputs(n), trace.inputs(n)
    targets = [list(trace.inputs(task.targets.shape[1]).entries) for _ in range(ahead)]
    multipliers = [trace.inputs(task.rows) for _ in range(ahead)]
    jerk = trace.inputs(n)
    before, rate = posture, velocity
    total, equations, slopes, lagrangian = tape.constant(0.0), list[int](), list[int](), list[object]()
    for left, q, wanted, multiplier in zip(reversed(range(ahead)), samples, targets, multipliers, strict=True):
        dq = (q - before) * (1.0 / interval)
        ddq = (dq - rate) * (1.0 / interval)
        before, rate = q, dq
        motion = TracedMotion(task, trace, q, dq, ddq, jerk, float(np.ptp(task.times)))
        value = trace_sample_function(motion, what, objective.function)
        if value is None:
            raise InvalidInput(f"{what}: looks at more than one sample")
        term = Expression(tape, as_entry(tape, value)) * (objective.sign * interval * (1.0 if left else 1.0 + terminal))
        total = as_entry(tape, Expression(tape, total) + term)
        links, begun = link_frames(task.arm, list(q.entries)), 0
        for each in task.tasks:
            found = each.equations(task.arm, links, wanted[begun : begun + each.target_size])
            equations += [as_entry(tape, one) for one in found]
            slopes += [as_entry(tape, one) for row in each.jacobian(task.arm, links) for one in row]
            begun += each.target_size
        lagrangian += list(multiplier.entries)
    read, variables = set(dependencies(tape, [total])), [as_entry(tape, one) for q in samples for one in q.entries]
    if read & {as_entry(tape, one) for one in jerk.entries} or trace.parameters:
        raise InvalidInput(f"{what}: wants a function of positions, velocities and accelerations of one sample alone")
    if not read & set(variables):
        raise InvalidInput(f"{what}: is the same whatever {task.arm.name} does; has it no masses?")
    weighed = Expression(tape, total)
    for one, equation in zip(lagrangian, equations, strict=True):
        weighed = weighed + one * Expression(tape, equation)
    second = hessian(tape, as_entry(tape, weighed), variables)
    places = np.array(list(second)).reshape(-1, 2).T
    return Horizon(
        ahead=ahead,
        dof=n,
        rows=task.rows,
        interval=interval,
        first=compile_evaluator(tape, [total, *gradient(tape, total, variables), *equations, *slopes]),
        second=compile_evaluator(tape, list(second.values())),
        places=(places[0], places[1]),
    )


@cache
def _compiled() -> Any:
    from paretoik.resolution.horizon_newton import minimised  # here: numba takes its time

    return minimised

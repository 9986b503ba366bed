"""Polishing motions: a batch of starts to their local optima.

The compiled interior-point method takes programs whose totals are sums of smooth functions of a sample, unless another
solver is wanted; sequential quadratic programming takes all.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from typing import Any, get_args

import numpy as np
from jaxtyping import Float

from paretoik.errors import InvalidInput
from paretoik.nlp import sqp
from paretoik.nlp.compiled.interior_point import CONVERGED, STUCK, Rules, minimise
from paretoik.nlp.program import Goal, Solver
from paretoik.nlp.solutions import Solutions
from paretoik.nlp.sqp import SqpOptions
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.transcription import MotionProgram, motion_program


def polish(
    program: MotionProgram,
    q: Float[np.ndarray, "motions time dof"],
    factors: Float[np.ndarray, "#motions totals"],
    caps: Float[np.ndarray, "#motions totals"] | None = None,
    rules: Rules | Sequence[Rules] = Rules(),
    *,
    solver: Solver | None = None,
) -> Solutions:
    """Return the local optima of Σ factors · totals, the totals below ``caps``, that starts on the path lead to.

    Every start goes its own way, whatever else is in the batch; ``rules`` are for all, or one a start. The program's
    own caps hold as well, and its own solver is taken where none is given.

    Raises InvalidInput where interior points are wanted for a program with kinks.
    """
    if solver is not None:
        check_solver(program.task, solver)
        program = replace(program, solver=solver)
    count, q = len(q), program.project(q)
    each = [rules] * count if isinstance(rules, Rules) else list(rules)
    weights = np.broadcast_to(factors, (count, len(program.totals)))
    below = np.broadcast_to(np.inf if caps is None else caps, (count, len(program.totals)))
    below = np.minimum(below, program.upper)
    minimise_batch = _general if program.kernel is None else _compiled
    found = minimise_batch(program, q, weights, below, each)
    if program.task.ends_at_rest:
        # How the last sample follows is known up to the path's own last step: below that no step makes it better.
        near = (found.status == STUCK) & (found.stationarity <= program.rounding) & (found.violation <= 1e-8)
        found.status[near] = CONVERGED
    if program.task.start is not None:
        found.x[:, 0] = program.task.start  # to the bit: leading back to the path may have rounded it
    return found


def check_solver(task: MotionTask, solver: Solver) -> None:
    """Raise InvalidInput for a solver that is unknown, or that cannot take a task, naming what has kinks."""
    if solver not in get_args(Solver):
        raise InvalidInput(f"solver must be one of {', '.join(get_args(Solver))}, got {solver!r}")
    if solver != "interior-point" or motion_program(task).is_smooth:
        return
    alone = [(each.name, replace(task, objectives=(each,), constraints=())) for each in task.objectives]
    alone += [(each.name, replace(task, objectives=(), constraints=(each,))) for each in task.constraints]
    kinked = ", ".join(name for name, part in alone if not motion_program(part).is_smooth)
    raise InvalidInput(f"solver: 'interior-point' wants smooth functions, {kinked or 'a limit'} has kinks: take 'sqp'")


def within_limits(
    program: MotionProgram,
    q: Float[np.ndarray, "motions time dof"],
    caps: Float[np.ndarray, " totals"],
    rules: Rules,
) -> Solutions:
    """Return the motions that violate limits and caps least, locally: nothing else is minimised.

    Where their status says that they converged, they hold.
    """
    return _general(
        program,
        q,
        np.zeros((len(q), len(caps))),
        np.tile(np.minimum(caps, program.upper), (len(q), 1)),
        [rules] * len(q),
    )


def _compiled(
    program: MotionProgram, q: np.ndarray, weights: np.ndarray, below: np.ndarray, rules: Sequence[Rules]
) -> Solutions:
    count = len(q)

    def one(i: int) -> tuple[Any, ...]:
        return minimise(program.kernel, np.ascontiguousarray(q[i]), weights[i].copy(), below[i].copy(), rules[i])

    found = list(_pool().map(one, range(count))) if count > 1 else [one(i) for i in range(count)]
    return Solutions(
        x=np.array([one[0] for one in found]).reshape(q.shape),
        status=np.array([one[1] for one in found], dtype=int),
        iterations=np.array([one[2] for one in found], dtype=int),
        objectives=np.array([one[3] for one in found]).reshape(count, len(program.totals)),
        stationarity=np.array([one[5] for one in found], dtype=float),
        violation=np.array([one[6] for one in found], dtype=float),
    )


@cache
def _pool() -> ThreadPoolExecutor:
    """Return threads, one a core, that last as long as the process: compiled code leaves Python's lock alone."""
    return ThreadPoolExecutor(os.cpu_count() or 1)


os.register_at_fork(after_in_child=_pool.cache_clear)  # threads do not come along


def _general(
    program: MotionProgram, q: np.ndarray, weights: np.ndarray, below: np.ndarray, rules: Sequence[Rules]
) -> Solutions:
    rows = np.eye(len(program.totals))
    solutions = [
        sqp.minimise(
            program,
            motion,
            Goal(weights=weight, rows=rows, upper=upper),
            SqpOptions(radius=rule.radius, iterations=rule.iterations, tolerance=rule.tolerance),
        )
        for motion, weight, upper, rule in zip(q, weights, below, rules, strict=True)
    ]
    return Solutions(
        x=np.array([one.x for one in solutions]).reshape(q.shape),
        status=np.array([one.status for one in solutions], dtype=int),
        iterations=np.array([one.iterations for one in solutions], dtype=int),
        objectives=np.array([one.objectives for one in solutions]).reshape(len(q), len(program.totals)),
        stationarity=np.array([one.stationarity for one in solutions], dtype=float),
        violation=np.array([one.violation for one in solutions], dtype=float),
    )

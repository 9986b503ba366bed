"""Plan one objective: all distinct locally optimal motions of a ``Tracking`` problem."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from paretoik.api.progress import Observer, RunProgress
from paretoik.errors import InvalidInput, check_size
from paretoik.formulations.gradients import require_program
from paretoik.formulations.tracking import Tracking
from paretoik.nlp.program import Solver
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.plan import Plan, find_optima


def plan(
    problem: Any,
    *,
    starts: int = 48,
    seed: int = 0,
    initial: Motion | None = None,
    solver: Solver = "auto",
    observe: Observer | None = None,
) -> Plan:
    """Return all distinct locally optimal motions of a ``Tracking`` with one objective that its starts lead to.

    Parameters
    ----------
    problem
        A ``Tracking`` with one integral objective.
    starts, seed
        Number of starts for every degree of redundancy, and the seed of their chance: the same seed gives the same
        plan. With functions without kinks, peaks or whole-motion parts more are tried: with one degree about three
        times as many while some optimum was reached from one or two only, and ways through a grid of postures where
        optima stay rare or are many; with more degrees starts near the best, while better ones come of it.
    initial
        Motions of the problem, on its path, to start from as well.
    solver
        "interior-point" for smooth objectives and limits, "sqp" (convex subproblems by Clarabel) for any; "auto" takes
        the first where it can.
    observe
        Called with a ``RunProgress`` after every level of samples, coarse to fine: ``done`` of all samples.

    ``plan.best.motion`` and ``plan.best.objective`` are the best, ``plan.optima`` all of them, best first. "Optimum" is
    meant locally. Source: Tringali & Cocuzza 2020, section 3.1.

    Raises
    ------
    InvalidInput
        Naming what cannot be used: several objectives, or one whose derivative cannot be had; OutOfReach where the
        path leaves what the arm can reach.
    Infeasible
        Where no motion within the limits was found, with the least-violating one and the limit that binds.
    SolverFailed
        Where motions within the limits were found, but none of them could be made optimal.

    >>> import paretoik as pk
    >>> path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=51)
    >>> found = plan(pk.Tracking(pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy]), starts=24)
    >>> round(found.best.objective, 3)
    0.038
    """
    check_size("starts", starts, 1)
    check_size("seed", seed, 0)
    require_program("plan", problem)
    if not isinstance(problem, Tracking):
        raise InvalidInput(
            f"plan: a Tracking wanted, got {type(problem).__name__}; epsilon_front or solve finds its front"
        )
    task = problem.task
    if len(task.objectives) != 1:
        names = ", ".join(o.name for o in task.objectives)
        raise InvalidInput(f"plan: one objective wanted, got {len(task.objectives)}: {names}")
    shown = _level_observer(observe, len(task.times))
    return find_optima(
        task, starts=starts, seed=seed, initial=_initial_motions(task, initial), solver=solver, observe=shown
    )


def _level_observer(observe: Observer | None, total: int) -> Callable[[int, int, int], object] | None:
    if observe is None:
        return None
    started = time.monotonic()

    def show(samples: int, starts: int, optima: int) -> None:
        observe(
            RunProgress(
                stage="sample",
                done=samples,
                total=total,
                seconds=time.monotonic() - started,
                summary=f"{starts} starts, {optima} distinct optima",
            )
        )

    return show


def _initial_motions(task: MotionTask, initial: Motion | None) -> np.ndarray | None:
    if initial is None:
        return None
    q = initial.q if initial.q.ndim == 3 else initial.q[None]
    if initial.arm.joint_names != task.arm.joint_names or q.shape[1] != len(task.times):
        raise InvalidInput(
            f"initial: motions of {task.arm.name} with {len(task.times)} samples wanted, got {initial.arm.name} with "
            f"{q.shape[1]}"
        )
    deviation = float(task.motion(q).tracking_error.max())
    if deviation > 1e-6:
        raise InvalidInput(f"initial: motions on the path wanted, got one that is {deviation:.3g} m or rad off")
    return np.array(q)

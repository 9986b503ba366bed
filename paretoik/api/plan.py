"""The verbs of the face that need no search: plan one motion's optima, find a certified front by ε-constraints."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from paretoik.api.refine import certified, smooth_certified, task_of
from paretoik.errors import InvalidInput, check_size
from paretoik.front.front import Front
from paretoik.pareto import epsilon as smooth_epsilon
from paretoik.pareto.refine import SmoothProblem
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.epsilon import epsilon_points
from paretoik.trajectory.multistart import Plan, planned


def plan(
    problem: Any,
    *,
    starts: int = 48,
    seed: int = 0,
    initial: Motion | None = None,
    observe: Callable[[int, int, int], object] | None = None,
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
    observe
        Called after every level of samples, coarse to fine, with its samples, starts and distinct optima.

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
    >>> found = plan(pk.Tracking(pk.tringali_3r(), path, objectives=[pk.kinetic_energy]), starts=24)
    >>> round(found.best.objective, 3)
    0.038
    """
    check_size("starts", starts, 1)
    check_size("seed", seed, 0)
    task = task_of("plan", problem)
    if len(task.objectives) != 1:
        names = ", ".join(o.name for o in task.objectives)
        raise InvalidInput(f"plan: one objective wanted, got {len(task.objectives)}: {names}")
    return planned(task, starts=starts, seed=seed, given=_given(task, initial), observe=observe)


def epsilon_front(
    problem: Any,
    *,
    points: int = 20,
    starts: int = 48,
    seed: int = 0,
    observe: Callable[[int, int], object] | None = None,
) -> Front:
    """Return a front of certified points: one objective minimised, the others kept below ε.

    Parameters
    ----------
    problem
        A ``Tracking`` with two or more integral objectives, a ``DirectionalMaxima`` or a ``PointToPoint``.
    points
        At most so many points, spread over the front; the best of every objective are always among them.
    starts, seed
        As for ``plan``, which finds each objective's own optima first; without a path each objective is minimised
        from so many starts.
    observe
        Called with the points found so far and those wanted.

    Every point has its certificate in ``front.certificates``; "optimal" is meant locally. Source: Tringali & Cocuzza
    2020, section 4.3.

    Raises
    ------
    InvalidInput
        Naming what cannot be used; OutOfReach where the path leaves what the arm can reach.
    Infeasible
        Where no motion within the limits was found, with the least-violating one and the limit that binds.
    SolverFailed
        Where an end of the front could not be made optimal.
    """
    check_size("points", points, 2)
    check_size("starts", starts, 1)
    check_size("seed", seed, 0)
    said = {"settings": {"points": points, "starts": starts, "seed": seed}, "status": "epsilon"}
    if isinstance(problem, SmoothProblem):
        if len(problem.names) < 2:
            raise InvalidInput("epsilon_front: two objectives or more wanted, got one: solve finds its optimum")
        begun = problem.unknowns(problem.candidates(starts, np.random.default_rng(seed)))
        z, ranges = smooth_epsilon.epsilon_points(problem.sketch(), begun, points=points, observe=observe)
        return smooth_certified(problem, z, np.arange(len(z)), ranges, said)
    task = task_of("epsilon_front", problem)
    if len(task.objectives) < 2:
        raise InvalidInput("epsilon_front: two objectives or more wanted, got one: plan finds its optima")
    found = epsilon_points(task, points=points, starts=starts, seed=seed, observe=observe)
    return certified(problem, task, found.q, np.arange(len(found.q)), found.ranges, said)


def _given(task: MotionTask, initial: Motion | None) -> np.ndarray | None:
    if initial is None:
        return None
    q = initial.q if initial.q.ndim == 3 else initial.q[None]
    if initial.arm.joint_names != task.arm.joint_names or q.shape[1] != len(task.times):
        raise InvalidInput(
            f"initial: motions of {task.arm.name} with {len(task.times)} samples wanted, got {initial.arm.name} with "
            f"{q.shape[1]}"
        )
    off = float(task.motion(q).tracking_error.max())
    if off > 1e-6:
        raise InvalidInput(f"initial: motions on the path wanted, got one that is {off:.3g} m or rad off")
    return np.array(q)

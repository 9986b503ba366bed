"""Find a certified front by ε-constraints: one objective minimised, the others bounded."""

from __future__ import annotations

from typing import Any

import numpy as np

from paretoik.api.progress import Observer, count_observer
from paretoik.api.refine import certified, smooth_certified, task_of
from paretoik.errors import InvalidInput, check_size
from paretoik.front.front import Front
from paretoik.pareto import epsilon as smooth_epsilon
from paretoik.pareto.refine import SmoothProblem
from paretoik.trajectory.epsilon import epsilon_points


def epsilon_front(
    problem: Any,
    *,
    points: int = 20,
    starts: int = 48,
    seed: int = 0,
    observe: Observer | None = None,
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
        Called with a ``RunProgress`` after every point: ``done`` of ``points``.

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
    show = count_observer(observe, "point")
    provenance = {"settings": {"points": points, "starts": starts, "seed": seed}, "status": "epsilon"}
    if isinstance(problem, SmoothProblem):
        if len(problem.names) < 2:
            raise InvalidInput("epsilon_front: two objectives or more wanted, got one: solve finds its optimum")
        initial = problem.unknowns(problem.candidates(starts, np.random.default_rng(seed)))
        z, ranges = smooth_epsilon.epsilon_points(problem.sketch(), initial, points=points, observe=show)
        return smooth_certified(problem, z, np.arange(len(z)), ranges, provenance)
    task = task_of("epsilon_front", problem)
    if len(task.objectives) < 2:
        raise InvalidInput("epsilon_front: two objectives or more wanted, got one: plan finds its optima")
    front = epsilon_points(task, points=points, starts=starts, seed=seed, observe=show)
    return certified(problem, task, front.q, np.arange(len(front.q)), front.ranges, provenance)

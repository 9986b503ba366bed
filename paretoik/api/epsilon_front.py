"""Find a certified front by ε-constraints: one objective minimised, the others bounded."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from paretoik.api.certified_front import certified_front
from paretoik.api.initial import initial_points
from paretoik.api.progress import Observer, count_observer
from paretoik.api.run_session import verb_session
from paretoik.arrays import Genes
from paretoik.errors import InvalidInput, check_size
from paretoik.formulations.requirements import require_program
from paretoik.front.front import Front
from paretoik.nlp.minimise import check_solver
from paretoik.nlp.program import Solver
from paretoik.pareto.epsilon import epsilon_points
from paretoik.task.motion import Motion


def epsilon_front(
    problem: Any,
    *,
    points: int = 20,
    starts: int | None = None,
    seed: int = 0,
    initial: Genes | Motion | Front | None = None,
    solver: Solver = "auto",
    observe: Observer | bool | None = None,
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
        from so many starts, 48 by default.
    initial
        Solutions to start from as well: motions on the path, genes, or a front. No feasible one of them dominates a
        point of the front.
    solver
        "interior-point" for smooth objectives and limits, "sqp" (convex subproblems by Clarabel) for any; "auto" takes
        the first where it can.
    observe
        Called with a ``RunProgress`` while each objective's optima are sought, after every point (``done`` of
        ``points``), and after each point's certificate. By default a bar shows it where stderr is a terminal; True
        prints lines elsewhere, False shows nothing.

    Ctrl-C and SIGTERM end the sweep within a second: the points so far are returned, those that have no certificate yet
    as "undetermined", with the signal in ``front.provenance["status"]``.

    Every point has its certificate in ``front.certificates``; "optimal" is meant locally. Source: Tringali & Cocuzza
    2020, section 4.3.

    Raises
    ------
    InvalidInput
        Naming what cannot be used; OutOfReach where the path leaves what the arm can reach.
    Infeasible
        Where no motion within the limits was found, with the least-violating one and the limit that binds.
    SolverFailed
        Where no start leads to an optimum of one of the objectives alone.
    """
    check_size("points", points, 2)
    if starts is not None:
        check_size("starts", starts, 1)
    check_size("seed", seed, 0)
    formulation = require_program("epsilon_front", problem)
    if len(formulation.names) < 2:
        raise InvalidInput("epsilon_front: two objectives or more wanted, got one: plan finds its optima")
    settings = {"points": points, "starts": starts, "seed": seed, "solver": solver}
    with verb_session(observe) as session:
        check_solver(formulation.program(), solver)
        cold = formulation.cold_search(
            starts=starts, seed=seed, solver=solver, observe=count_observer(session.observe, "optimum")
        )
        x, ranges = epsilon_points(
            formulation.program,
            cold,
            len(formulation.names),
            points=points,
            initial=initial_points(formulation, initial),
            solver=solver,
            observe=count_observer(session.observe, "point"),
        )
        front = certified_front(
            problem,
            formulation,
            x,
            np.arange(len(x)),
            ranges,
            {"settings": settings},
            solver=solver,
            observe=session.observe,
        )
        status = {"status": session.signal or "epsilon", "counts": {"seconds": round(session.seconds, 3)}}
        return replace(front, provenance={**front.provenance, **status})

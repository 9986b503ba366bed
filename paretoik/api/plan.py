"""Plan one objective: all distinct locally optimal motions of a ``Tracking`` problem."""

from __future__ import annotations

from typing import Any

from paretoik.api.progress import Observer, count_observer
from paretoik.api.run_session import verb_session
from paretoik.errors import check_size
from paretoik.formulations.requirements import require_plan
from paretoik.nlp.program import Solver
from paretoik.task.motion import Motion
from paretoik.trajectory.plan import Plan


def plan(
    problem: Any,
    *,
    starts: int | None = None,
    seed: int = 0,
    initial: Motion | None = None,
    solver: Solver = "auto",
    observe: Observer | bool | None = None,
) -> Plan:
    """Return all distinct locally optimal motions of a ``Tracking`` with one objective that its starts lead to.

    Parameters
    ----------
    problem
        A ``Tracking`` with one integral objective.
    starts, seed
        Number of starts for every degree of redundancy, and the seed of their chance: the same seed gives the same
        plan. By default up to 48, until hardly a better optimum is unseen. With functions without kinks, peaks or
        whole-motion parts more are tried: with one degree about three times as many while some optimum was reached from
        one or two only, and ways through a grid of postures where optima stay rare or are many; with more degrees,
        where optima are rare, starts near the best, while better ones come of it.
    initial
        Motions of the problem, on its path, to start from as well.
    solver
        "interior-point" for smooth objectives and limits, "sqp" (convex subproblems by Clarabel) for any; "auto" takes
        the first where it can.
    observe
        Called with a ``RunProgress`` after every level of samples, coarse to fine: ``done`` of all samples. By default
        a bar shows it where stderr is a terminal; True prints lines elsewhere, False shows nothing.

    ``plan.best.motion`` and ``plan.best.objective`` are the best, ``plan.optima`` all of them, best first. "Optimum" is
    meant locally. Ctrl-C and SIGTERM end the search within a second: the optima so far are returned, if need be those
    of coarser samples with "interrupted" for a status. Source: Tringali & Cocuzza 2020, section 3.1.

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
    >>> optima = plan(pk.Tracking(pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy]), starts=24)
    >>> round(optima.best.objective, 3)
    0.038
    """
    if starts is not None:
        check_size("starts", starts, 1)
    check_size("seed", seed, 0)
    find_optima = require_plan(problem)
    samples = len(problem.task.times)
    with verb_session(observe) as session:
        show = count_observer(session.observe, "sample")

        def show_level(done: int, starts: int, optima: int) -> None:
            if show is not None:
                show(done, samples, f"{starts} starts, {optima} distinct optima")

        return find_optima(starts=starts, seed=seed, initial=initial, solver=solver, observe=show_level)

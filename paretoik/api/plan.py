"""Plan one objective: all distinct locally optimal motions of a ``Tracking`` problem."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from paretoik.api.initial import remembered_motions
from paretoik.api.least_violating import infeasible_recorded
from paretoik.api.plan_display import PlanDisplay
from paretoik.api.plan_storage import save_plan
from paretoik.api.progress import Observer
from paretoik.api.run_session import Subject, run_session
from paretoik.api.verb_session import computing
from paretoik.call_arguments import check_call
from paretoik.execution.executor import check_workers
from paretoik.execution.time_limit import check_time_limit
from paretoik.formulations.requirements import require_plan
from paretoik.inputs import check_count, check_flag, check_seed
from paretoik.nlp.minimise import check_solver
from paretoik.nlp.program import Solver, check_solver_name
from paretoik.task.motion import Motion
from paretoik.trajectory.plan import Plan


@check_call
def plan(
    problem: Any,
    *,
    starts: int | None = None,
    seed: int = 0,
    initial: Motion | None = None,
    solver: Solver = "auto",
    out: str | Path | None = None,
    time_limit: float | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    overwrite: bool = False,
    reference: str | None = None,
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
    out
        Folder to keep the run in: run.json, optima.parquet and motions.npz (``load_plan`` opens them), review.rrd with
        every start, what it led to and the optima, and picture.png (not after a signal). ``overwrite`` allows it to
        replace a run that is there.
    time_limit
        Seconds of computing, as for ``solve``, after which the search ends and keeps what it has.
    workers, cluster
        As for ``solve``: starts are solved there.
    reference
        Where the problem can be loaded from (``file.py:name``), kept in the run for ``load_plan``.
    observe
        Called with a ``RunProgress`` after every level of samples, coarse to fine: ``done`` of all samples. By default
        a bar shows it where stderr is a terminal; True prints lines elsewhere, False shows nothing.

    ``plan.best.motion`` and ``plan.best.objective`` are the best, ``plan.optima`` all of them, best first. "Optimum" is
    meant locally. Ctrl-C, SIGTERM and the time limit end the search within a second: the optima so far are returned, if
    need be those of coarser samples with "interrupted" for a status; why it ended stands in
    ``plan.provenance["status"]``. Source: Tringali & Cocuzza 2020, section 3.1.

    Raises
    ------
    InvalidInput
        Naming what cannot be used: several objectives, or one whose derivative cannot be had; OutOfReach where the
        path leaves what the arm can reach.
    Infeasible
        Where no motion within the limits was found, with the least-violating one and the limit that binds.
    SolverFailed
        Where motions within the limits were found, but none of them could be made optimal, or none was found within
        the time limit.

    >>> import paretoik as pk
    >>> path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=51)
    >>> optima = plan(pk.Tracking(pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy]), starts=24)
    >>> round(optima.best.objective, 3)
    0.038
    """
    check_count("starts", starts)
    check_seed("seed", seed)
    check_time_limit(time_limit)
    check_workers(workers, cluster)
    check_flag("overwrite", overwrite)
    check_solver_name(solver)
    find_optima = require_plan(problem)
    if solver != "auto":  # which takes what there is, and looks at values before derivatives
        with computing(time_limit):  # users' functions are traced
            check_solver(problem.program(), solver)
    settings = {
        "starts": starts,
        "seed": seed,
        "initial": initial is not None,
        "solver": solver,
        "time_limit": time_limit,
    }
    with run_session(
        Subject.of(problem, reference),
        verb="plan",
        settings=settings,
        out=out,
        overwrite=overwrite,
        observe=observe,
        time_limit=time_limit,
        resumable=True,
        workers=workers,
        cluster=cluster,
    ) as session:
        initial = remembered_motions(problem, initial)
        display = PlanDisplay(session, problem)
        recorded = infeasible_recorded(session, problem, display.infeasible_end)
        with session.computing(time_limit), recorded:
            plan = find_optima(starts=starts, seed=seed, initial=initial, solver=solver, observe=display.show_level)
        counts = {"optima": len(plan.optima), "starts": plan.starts, "seconds": round(session.seconds, 3)}
        ending = {"status": session.stopped_by or "optima", "counts": counts, **plan.provenance}
        plan = replace(plan, provenance={**session.provenance, **ending})
        (name,), (unit,), (maximised,) = problem.names, problem.units, problem.maximised
        save = partial(save_plan, plan, name=name, unit=unit, maximised=bool(maximised))
        session.keep(plan, save, status=plan.provenance["status"])
        with session.reviewing():
            display.review(plan)
    return plan

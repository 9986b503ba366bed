"""Find a certified front by ε-constraints: one objective minimised, the others bounded."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.certificate_time import LaterStages
from paretoik.api.certified_front import certified_front
from paretoik.api.initial import initial_points, remembered_points
from paretoik.api.least_violating import infeasible_recorded
from paretoik.api.progress import Observer
from paretoik.api.refine import resolve_front
from paretoik.api.review_front import review_front
from paretoik.api.run_session import RunSession, Subject, run_session
from paretoik.api.sweep_display import SweepDisplay
from paretoik.api.verb_session import computing
from paretoik.arrays import Genes, Points
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.execution.executor import check_workers
from paretoik.execution.time_limit import check_time_limit
from paretoik.formulations.protocol import Differentiable
from paretoik.formulations.requirements import require_program
from paretoik.front.front import Front
from paretoik.inputs import check_count, check_flag, check_seed, check_size
from paretoik.nlp.minimise import check_solver
from paretoik.nlp.program import Solver
from paretoik.pareto.epsilon import epsilon_points
from paretoik.review.recording.workcell import workcell_of
from paretoik.task.motion import Motion


@check_call
def epsilon_front(
    problem: Any,
    *,
    points: int = 20,
    starts: int | None = None,
    seed: int = 0,
    initial: Genes | Motion | Front | None = None,
    solver: Solver = "auto",
    out: str | Path | None = None,
    time_limit: float | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    overwrite: bool = False,
    reference: str | None = None,
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
    out
        Folder to keep the run in: run.json, front.parquet, motions.npz, review.rrd with the levels of ε on the timeline
        ``level``, and pictures (not after a signal). ``overwrite`` allows it to replace a run that is there.
    time_limit
        Seconds of computing, as for ``solve``, after which the sweep ends and keeps what it has; up to two
        fifths of them are left for certificates, half of these for limits between samples.
    workers, cluster
        As for ``solve``: starts are solved there, levels of ε that can be foretold, and points certified.
    reference
        Where the problem can be loaded from (``file.py:name``), kept in the run for ``load_front``.
    observe
        Called with a ``RunProgress`` while each objective's optima are sought, after every level of ε (``done`` of
        ``points``), and after each point's certificate. By default a bar shows it where stderr is a terminal; True
        prints lines elsewhere, False shows nothing.

    Ctrl-C, SIGTERM and the time limit end the sweep within a second: the points so far are returned, those that have no
    certificate yet as "undetermined"; why it ended stands in ``front.provenance["status"]``.

    Every point has its certificate in ``front.certificates``; "optimal" is meant locally. Source: Tringali & Cocuzza
    2020, section 4.3.

    Raises
    ------
    InvalidInput
        Naming what cannot be used; OutOfReach where the path leaves what the arm can reach.
    Infeasible
        Where no motion within the limits was found, with the least-violating one and the limit that binds.
    SolverFailed
        Where no start leads to an optimum of one of the objectives alone, or the time limit comes before one does.
    """
    check_size("points", points, 2)
    check_count("starts", starts)
    check_seed("seed", seed)
    check_time_limit(time_limit)
    check_workers(workers, cluster)
    check_flag("overwrite", overwrite)
    formulation = require_program("epsilon_front", problem)
    if len(formulation.names) < 2:
        raise InvalidInput("epsilon_front: two objectives or more wanted, got one: plan finds its optima")
    with computing(time_limit):  # users' functions are traced
        check_solver(formulation.program(), solver)
    starting = initial_points(formulation, initial)
    settings = {
        "points": points,
        "starts": starts,
        "seed": seed,
        "initial": initial is not None,
        "solver": solver,
        "time_limit": time_limit,
    }
    with run_session(
        Subject.of(problem, reference),
        verb="epsilon_front",
        settings=settings,
        out=out,
        overwrite=overwrite,
        observe=observe,
        time_limit=time_limit,
        resumable=True,
        workers=workers,
        cluster=cluster,
    ) as session:
        starting = remembered_points(starting)
        with session.computing(time_limit):
            front = _sweep(problem, formulation, starting, session)
        session.finish(front)
        with session.reviewing():
            review_front(front, session)
    return front


def _sweep(problem: Any, formulation: Differentiable, initial: Points | None, session: RunSession) -> Front:
    """Return the certified front of a sweep by the settings of a session, which sees its steps."""
    settings = session.provenance["settings"]
    session.start(
        names=formulation.names,
        units=formulation.units,
        maximised=formulation.maximised,
        timeline="level",
        workcell=workcell_of(problem),
    )
    solver = settings["solver"]
    display = SweepDisplay(session, formulation, solver)
    reserve = LaterStages.of(problem).reserve(settings["points"])
    with infeasible_recorded(session, problem, display.infeasible_end), reserve:
        cold = formulation.cold_search(
            starts=settings["starts"],
            seed=settings["seed"],
            solver=solver,
            observe=display.show_optima,
        )
        x, ranges = epsilon_points(
            formulation.program,
            cold,
            len(formulation.names),
            points=settings["points"],
            initial=initial,
            solver=solver,
            observe=display.show_step,
        )
    front = certified_front(
        problem,
        formulation,
        x,
        np.arange(len(x)),
        ranges,
        dict(session.provenance),
        solver=solver,
        observe=session.observe,
        later=display.later,
    )
    front = resolve_front(front, solver, session.observe)
    display.finish(front)
    counts = {"points": len(front), "levels": display.levels, "seconds": round(session.seconds, 3)}
    ending = {"status": session.stopped_by or "epsilon", "counts": counts, "computed": session.provenance["computed"]}
    return replace(front, provenance={**front.provenance, **ending})

"""Solve a problem into its Pareto front: search for it, or follow a closed loop."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from paretoik.api.follow_loop import LoopRun
from paretoik.api.progress import Observer
from paretoik.api.search_front import FrontSearch
from paretoik.api.session import SolveSettings, Subject, run_session
from paretoik.arrays import Genes
from paretoik.formulations.protocol import timeline
from paretoik.front.front import Front
from paretoik.inputs import check_call, check_flag
from paretoik.nlp.program import Solver
from paretoik.runs.interruption import limited_evaluations
from paretoik.task.motion import Motion

RUNS: dict[str, type[FrontSearch] | type[LoopRun]] = {
    "generation": FrontSearch,
    "step": LoopRun,
}  # how a problem is solved, by what its run counts


@check_call
def solve(
    problem: Any,
    *,
    population: int | None = None,
    generations: int | None = None,
    seed: int | None = None,
    islands: int = 1,
    out: str | Path | None = None,
    initial: Genes | Motion | Front | None = None,
    time_limit: float | None = None,
    evaluations: int | None = None,
    target: Sequence[float] | None = None,
    stagnation: bool = True,
    anchors: int | None = None,
    algorithm: Any = None,
    points: int | None = 200,
    refine: bool = False,
    solver: Solver = "auto",
    workers: int | None = None,
    cluster: str | None = None,
    evaluation_timeout: float | None = None,
    overwrite: bool = False,
    record_steps: Sequence[int] = (),
    live: bool = False,
    reference: str | None = None,
    observe: Observer | bool | None = None,
) -> Front:
    """Search for the Pareto front of any pymoo problem and return it; follow a ``ClosedLoop``.

    A closed loop becomes a front of one point: the motion, of which every objective is the mean over the steps. Its
    ``front.select(Weights(...))`` follows the loop anew with other weights at every step.

    Parameters
    ----------
    problem
        A ``Tracking``, ``PointToPoint``, ``DirectionalMaxima``, ``Tuning`` or ``ClosedLoop``, or any pymoo problem with
        real genes (its front then has no motions).
    population, generations, seed
        Size of the population (200), most generations (500), and the seed of all chance (0): the same seed gives the
        same front. A closed loop has its own where none are given.
    islands
        So many populations, each with chance of its own, of which every ten generations some of the best go to the
        next, in a ring. Their rows are evaluated together, so that there is more for many ``workers`` to do at a time.
    out
        Folder to keep the run in: run.json, front.parquet, motions.npz, review.rrd, front.png (not after a signal), of
        a closed loop steps.parquet too. ``overwrite`` allows it to replace a run that is there.
    initial
        Start from genes (rows, genes), motions on the path, or a former front.
    time_limit, evaluations, target, stagnation
        Further endings: seconds of computing (compiling code in this process, once for a copy of paretoik, is not
        counted), of which ``refine`` has a part; a number of evaluations; values to be reached by one point (one an
        objective, in its own sign); whether to stop when the front has not improved for 20 generations.
    anchors
        Generations spent on each objective alone before all are searched together; None takes half of all, shared
        by the objectives, on problems with branches, where the ends of a front can lie in basins of their own.
    algorithm
        Any pymoo genetic algorithm in place of ``MaxiMinNSGA2``, with its own sizes.
    points
        Most points of the front: of more, those that MaxiMin spreads over it; None keeps all.
    refine
        Whether gradients help: every ten generations a few iterations at the ends, in the widest gaps and in every
        branch, up to 30 % of the evaluations; at the end every point is refined to a local optimum, the best of
        every objective that the planner finds are added, and points where they gain more than others, at most so many
        as ``points``; all are certified. Of a ``time_limit`` the search has half, unless it ends before. For a
        ``Tracking``, ``DirectionalMaxima`` and ``PointToPoint``, as with ``refine(front)``.
    solver
        Which solver ``refine`` uses: "interior-point" for smooth objectives and limits, "sqp" (convex subproblems by
        Clarabel) for any; "auto" takes the first where it can.
    workers, cluster
        So many processes on this machine that rows are evaluated in, or the address of a Dask scheduler,
        "tcp://HOST:PORT", whose workers do it (``pip install "paretoik[cluster]"``; started by ``dask scheduler`` and
        ``dask worker ADDRESS --nworkers 8 --nthreads 1``); without either it is this process. The front is the same,
        bit for bit, but workers are worth it only where a row takes some milliseconds; a warning says when they are
        not. A problem has to be one that can be sent: its code goes along, the files that it opens do not. A row that
        ends four workers has failed.
    evaluation_timeout
        Seconds that the evaluation of one row may take: then it is ended and has failed, whatever it was doing. Rows
        are evaluated one by one, in workers, one of them by default. The first row of a new worker has 5 s more, as
        code is loaded then.
    record_steps
        Steps of a closed loop, from 1 on, whose searches are kept generation by generation, in searches.npz and on the
        recording's timelines ``generation`` and ``individual``: populations, fronts, what was chosen, and the arms.
    live
        Whether a viewer opens that shows the recording, which wants ``out``, while the run goes on: on this machine
        alone, and without a screen one can be attached at the address that stderr says.
    reference
        Where the problem can be loaded from (``file.py:name``), kept in the run for ``load_front``.
    observe
        Called with a ``RunProgress`` after every generation, or step, and every point that is refined. By default a bar
        shows it where stderr is a terminal; True prints lines elsewhere, False shows nothing.

    Of a closed loop ``islands``, ``initial``, ``evaluations``, ``target``, ``anchors``, ``algorithm``, ``refine``,
    ``solver``, ``workers``, ``cluster`` and ``evaluation_timeout`` mean nothing and are refused; ``points`` and
    ``stagnation`` have no effect.

    Ctrl-C and SIGTERM end the search, or the refinement, within a second or after the generation under way, and keep
    the result; why it ended stands in ``front.provenance["status"]``, what it took in its ``counts``.

    An error that comes after the first generation, of an objective or of ``observe``, has the front found by then as
    its ``partial``; with ``out`` it is in the folder, too.

    Raises
    ------
    InvalidInput
        Naming what cannot be used.
    Infeasible
        Where nothing satisfied the limits: with the least-violating motion and the limit that binds.
    EvaluationFailed
        Where every evaluation failed, with the first cause.
    """
    check_flag("overwrite", overwrite)
    settings = SolveSettings(
        population=population,
        generations=generations,
        seed=seed,
        islands=islands,
        initial=initial,
        time_limit=time_limit,
        evaluations=evaluations,
        target=target,
        stagnation=stagnation,
        anchors=anchors,
        algorithm=algorithm,
        points=points,
        refine=refine,
        solver=solver,
        workers=workers,
        cluster=cluster,
        evaluation_timeout=evaluation_timeout,
        record_steps=record_steps,
    )
    run: FrontSearch | LoopRun = RUNS[timeline(problem)](problem, settings)
    limited = limited_evaluations(evaluation_timeout)
    with (
        limited,
        run_session(
            Subject.of(run.problem, reference),
            verb="solve",
            settings=run.settings,
            out=out,
            overwrite=overwrite,
            observe=observe,
            time_limit=settings.time_limit,
            live=live,
            resumable=True,
            workers=workers,
            cluster=cluster,
            isolated=evaluation_timeout is not None,
        ) as session,
    ):
        front = run.run(session)
        session.finish(front)
        with session.reviewing():
            run.review(front, session)
    return front

"""Find the Pareto front of a problem, or follow a closed loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from paretoik.api.follow_loop import LoopRun
from paretoik.api.search_front import FrontSearch
from paretoik.api.session import RunRequest, SolveSettings, open_session, surroundings
from paretoik.arrays import Genes
from paretoik.formulations.protocol import timeline
from paretoik.front.front import Front
from paretoik.nlp.program import Solver
from paretoik.progress import Observer
from paretoik.runs.interruption import limited_evaluations
from paretoik.task.motion import Motion


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
    """Return the Pareto front of a pymoo problem, or follow a ``ClosedLoop``.

    Parameters
    ----------
    problem
        Pymoo problem (``Tracking``, ``PointToPoint``, ``DirectionalMaxima``, ``Tuning``, yours), or ``ClosedLoop``.
    population
        Size of the population (default 200, or that of the closed loop).
    generations
        Most generations (default 500, or those of the closed loop).
    seed
        Seed of all random numbers (default 0, or that of the closed loop); the same seed gives the same front.
    islands
        Number of populations (default 1). Every ten generations some of the best migrate to the next one, in a ring.
    out
        Folder for the run (default: none): run.json, front.parquet, motions.npz, review.rrd and front.png.
    initial
        Genes (rows, genes), motions on the path, or a former front to start from.
    time_limit
        Seconds of computing after which the search ends (default: no limit), without compilation.
    evaluations
        Number of evaluations after which the search ends (default: no limit).
    target
        Values, one per objective in its own sign, that end the search when one point reaches them.
    stagnation
        Whether to stop if the front has not improved for 20 generations (default True).
    anchors
        Generations for each objective alone, before the common search; default: half of all if there are branches.
    algorithm
        Genetic algorithm of pymoo in place of ``MaxiMinNSGA2``, with its own sizes.
    points
        Most points of the front, spread by MaxiMin (default 200); None keeps all.
    refine
        Whether gradients help the search, refine its points and certify them (default False).
    solver
        Solver of ``refine``: "interior-point" (smooth functions), "sqp" (any); "auto" (default): the first if it can.
    workers
        Number of processes on this machine that evaluate rows (default: only this process).
    cluster
        Address of a Dask scheduler, "tcp://HOST:PORT", whose workers evaluate rows.
    evaluation_timeout
        Seconds for the evaluation of one row, after which it is ended and has failed (default: no limit).
    overwrite
        Whether to replace a run in ``out`` (default False).
    record_steps
        Steps of a closed loop, from 1 on, whose searches are kept generation by generation (default: none).
    live
        Whether to open a viewer on the recording in ``out`` during the run (default False).
    reference
        Name of the problem, ``file.py:name``, kept in the run for ``load_front``.
    observe
        Function called with a ``RunProgress``; default: a bar on a terminal; True: lines elsewhere too; False: nothing.

    Returns
    -------
    Front
        Front of the search; for a closed loop one point: its motion, with the mean of each objective over the steps.

    Raises
    ------
    InvalidInput
        If an argument cannot be used.
    Infeasible
        If nothing satisfied the limits; has the least-violating motion and the limit that binds.
    EvaluationFailed
        If every evaluation failed; names the first cause.

    Notes
    -----
    Pymoo problems need real genes; the front of your own has no motions. ``front.select(Weights(...))`` on the front of
    a closed loop follows the loop again with other weights at every step. Not for closed loops: ``islands``,
    ``initial``, ``evaluations``, ``target``, ``anchors``, ``algorithm``, ``refine``, ``solver``, ``workers``,
    ``cluster`` and ``evaluation_timeout``; ``points`` and ``stagnation`` have no effect on them.

    Ctrl-C and SIGTERM end the search, or the refinement, within a second or after the current generation, and keep the
    result. ``front.provenance["status"]`` says why it ended, ``counts`` there what it took. If an objective or
    ``observe`` raises after the first generation, the error has the front so far as its ``partial``; the folder has it
    too.

    ``refine`` works for ``Tracking``, ``DirectionalMaxima`` and ``PointToPoint``, as ``refine(front)`` does. Every ten
    generations a few iterations improve the best points of each objective, the widest gaps and every branch, up to 30 %
    of the evaluations. At the end every point is refined to a local optimum, the best points of each objective that the
    planner finds are added, and points that gain more than others, up to ``points``; all are certified. The search has
    half of a ``time_limit``, unless it ends before. Compiling code in this process, once for a copy of paretoik, does
    not count. "sqp" solves convex subproblems by Clarabel.

    On problems with branches the best points of single objectives can lie in basins of their own: by default the
    objectives share half of all generations as ``anchors``. Islands are evaluated together, which gives many
    ``workers`` more to do at a time.

    ``workers`` and ``cluster`` change no bit of the front. They pay only if a row takes some milliseconds; a warning
    says when they do not. The problem is sent with its code, without files that it opens. A row that ends four workers
    has failed. A cluster needs ``pip install "paretoik[cluster]"``, ``dask scheduler``, and ``dask worker ADDRESS
    --nworkers 8 --nthreads 1``. With ``evaluation_timeout`` rows are evaluated one by one in workers, by default in
    one; the first row of a new worker has 5 s more, to load code.

    The folder of a closed loop also has steps.parquet, and searches.npz with the recorded steps: populations, fronts,
    choices and arms, on the recording's timelines ``generation`` and ``individual``. Pictures are not drawn after a
    signal. The viewer of ``live`` opens on this machine; without a screen, stderr says at which address to attach one.

    ``observe`` is called after every generation or step, and every refined point.
    """
    given = locals()  # settings are arguments of the same names
    settings = SolveSettings(**{each.name: given[each.name] for each in fields(SolveSettings)})
    run: FrontSearch | LoopRun = (LoopRun if timeline(problem) == "step" else FrontSearch)(problem, settings)
    request = RunRequest(
        verb="solve",
        problem=run.problem,
        settings=run.settings,
        resumable=True,
        isolated=evaluation_timeout is not None,
        **surroundings(given),
    )
    with limited_evaluations(evaluation_timeout), open_session(request) as session:
        return run.run(session)

"""Find a certified front: minimise one objective, bound the others by ε."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.initial import initial_points, remembered_initial
from paretoik.api.refine import resolve_front
from paretoik.api.session import RunRequest, Session, computing, open_session, surroundings
from paretoik.arrays import Genes
from paretoik.compilation_notices import computing_clock
from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import require_program
from paretoik.front.front import Front
from paretoik.front.hypervolume import HypervolumeCurve
from paretoik.front.preferences.knee_and_compromise import marked_rows
from paretoik.inputs import check_count, check_seed, check_size
from paretoik.nlp.minimise import check_solver
from paretoik.nlp.program import Solver
from paretoik.pareto.certified_front import Certifier, certified_front
from paretoik.pareto.epsilon import epsilon_points
from paretoik.pareto.refined_front import RefinedFront
from paretoik.pareto.sweep import SweepProgress
from paretoik.progress import Observer, count_observer
from paretoik.review.recording.messages import RecordedPoint, record_motion
from paretoik.review.recording.recorder import Generation
from paretoik.task.motion import Motion


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
    """Return a certified front: one objective minimised, the others bounded by ε.

    Parameters
    ----------
    problem
        ``Tracking`` with two or more integral objectives, ``DirectionalMaxima`` or ``PointToPoint``.
    points
        Maximum number of points, spread over the front (default 20); each objective's best is always included.
    starts
        Number of starts per objective for its own optima; default: as for ``plan``, or 48 without a path.
    seed
        Seed of all random numbers (default 0).
    initial
        Further starts: motions on the path, genes, or a front; no feasible one dominates a point of the result.
    solver
        Solver: "interior-point" (smooth functions), "sqp" (any, by Clarabel); "auto" (default): the first if possible.
    out
        Folder for the run (default: none): run.json, front.parquet, motions.npz, review.rrd and pictures.
    time_limit
        Computing time [s], as for ``solve``, after which the sweep ends and keeps its points (default: no limit).
    workers
        Number of processes, as for ``solve``, that compute starts, levels of ε known in advance, and certificates.
    cluster
        Address of a Dask scheduler in place of ``workers``, as for ``solve``.
    overwrite
        Whether to replace a run in ``out`` (default False).
    reference
        Name of the problem, ``file.py:name``, kept in the run for ``load_front``.
    observe
        Function called with a ``RunProgress``; default: a bar on a terminal; True: lines elsewhere too; False: nothing.

    Returns
    -------
    Front
        Front with a certificate for each point in ``front.certificates``.

    Raises
    ------
    InvalidInput
        If an argument cannot be used.
    OutOfReach
        If the path leaves the reach of the arm.
    Infeasible
        If no motion satisfies the limits; the error has the least-violating motion and the binding limit.
    SolverFailed
        If an objective has no optimum from any start, or none within the time limit.

    Notes
    -----
    "Optimal" is meant locally. Ctrl-C, SIGTERM and the time limit end the sweep within a second. The points so far are
    returned; those without a certificate are "undetermined". ``front.provenance["status"]`` says why the sweep ended.
    Up to two fifths of a time limit are reserved for certificates, half of this time for limits between samples.

    ``observe`` is called while each objective's optima are sought, after every level of ε (``done`` of ``points``), and
    after each point's certificate. In review.rrd the levels of ε are on the timeline ``level``. Pictures are not drawn
    after a signal.

    Source: Tringali & Cocuzza 2020, section 4.3.
    """
    given = surroundings(locals())
    check_size("points", points, 2)
    check_count("starts", starts)
    check_seed("seed", seed)
    formulation = require_program("epsilon_front", problem)
    if len(formulation.names) < 2:
        raise InvalidInput("problem must have two objectives or more for epsilon_front, got one; plan finds its optima")
    settings = {"points": points, "starts": starts, "seed": seed, "initial": initial is not None, "solver": solver}
    request = RunRequest(
        verb="epsilon_front",
        problem=problem,
        settings={**settings, "time_limit": time_limit},
        resumable=True,
        **given,
    )
    with computing(time_limit):  # users' functions are traced
        check_solver(formulation.program(), solver)
    starting = initial_points(formulation, initial)
    with open_session(request) as session:
        starting = remembered_initial(x=starting).get("x")
        with computing(time_limit, session):
            session.record_search(formulation, "level")
            certifier = Certifier(formulation=formulation, solver=solver, observe=session.observe)
            display = _SweepDisplay(session, certifier)
            with certifier.reserve_later(points):
                cold = formulation.cold_search(starts=starts, seed=seed, solver=solver, observe=display.show_optima)
                x, ranges = epsilon_points(
                    formulation.program,
                    cold,
                    len(formulation.names),
                    points=points,
                    initial=starting,
                    solver=solver,
                    observe=display.show_step,
                )
            front = certified_front(certifier, x, np.arange(len(x)), ranges, session.provenance)
            front = resolve_front(RefinedFront(front, np.zeros(0, dtype=bool), False), certifier).front
            display.finish(front)
        ending = session.ended(session.stopped_by or "epsilon", points=len(front), levels=display.levels)
        front = replace(front, provenance={**front.provenance, **ending})
        session.finish_front(front)
    return front


class _SweepDisplay:
    """Shows each step of a sweep in a session.

    levels: number of steps whose bounds differ from those of the step before
    """

    def __init__(self, session: Session, certifier: Certifier) -> None:
        self.levels = 0
        self._session, self._certifier = session, certifier
        self._signs = np.where(certifier.formulation.maximised, -1.0, 1.0)
        self._hypervolume = HypervolumeCurve()
        self._steps = self._points = 0
        self._level = b""
        self._started: float | None = None  # start of the sweep
        self._show_optima = count_observer(session.observe, "optimum")

    def show_optima(self, done: int, total: int, summary: str = "") -> None:
        """Show the search for each objective's own optima, before the sweep starts."""
        if self._show_optima is not None and self._started is None:
            self._show_optima(done, total, summary)

    def show_step(self, progress: SweepProgress) -> None:
        """Show a step, with objectives in the user's own sign."""
        self._started = computing_clock() if self._started is None else self._started
        level = b"" if progress.epsilon is None else progress.epsilon.tobytes()
        is_level = level not in (b"", self._level)
        if is_level:
            self.levels += 1
            self._level = level
        is_news, self._points = is_level or len(progress.x) > self._points, len(progress.x)
        if not self._session.is_watched:
            return
        generation = None
        if is_news:
            front, signs = progress.objectives[progress.front], self._signs
            points: tuple[RecordedPoint, ...] = ()
            if self._session.recorder is not None:  # the best point per objective and the compromise
                rows, axes = zip(*marked_rows(front, progress.front), strict=True)
                x = progress.x[progress.front[list(rows)]]
                motions = self._certifier.formulation.individuals(x).motions
                points = tuple(
                    RecordedPoint(
                        id=int(progress.front[row]),
                        objectives=front[row] * signs,
                        axis=axis,
                        motion=None if motions is None else record_motion(motions[place], curves=False),
                    )
                    for place, (row, axis) in enumerate(zip(rows, axes, strict=True))
                )
            generation = Generation(
                number=self._steps,
                population=progress.objectives * signs,
                front=front * signs,
                front_ids=progress.front,
                hypervolume=self._hypervolume.measure(front, self._steps),
                points=points,
                epsilon=None if progress.epsilon is None else progress.epsilon * signs,
            )
            self._steps += 1
        words = self._hypervolume.summary(self._steps - 1)
        shown = self._certifier.point_progress(progress, computing_clock() - self._started, words)
        self._session.show(replace(shown, generation=generation))

    def finish(self, front: Front) -> None:
        """Record the final front, which has no bound ε."""
        if self._session.recorder is not None:
            generation = Generation(
                number=self._steps,
                population=front.objectives,
                front=front.objectives,
                front_ids=front.ids,
                hypervolume=self._hypervolume.measure(front.minimised, self._steps),
            )
            self._session.record(generation)

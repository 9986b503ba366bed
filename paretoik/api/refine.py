"""Refine every point of a front to a certified local optimum, and suggest genes to a search."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float

from paretoik.api.certified_front import OPTIONS as CERTIFIED
from paretoik.api.certified_front import LaterStages, LaterTime, certified_front, no_worse
from paretoik.api.progress import Observer, RunProgress, count_observer
from paretoik.api.session import RunSession, Subject, computing, review_front, run_session, verb_session
from paretoik.arrays import Genes, Ids, Objectives, Point, Points, Values
from paretoik.compilation_notices import computing_clock
from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import Differentiable, ProblemParts, at_samples_of, require_program
from paretoik.front import indicators
from paretoik.front.front import Front
from paretoik.front.indicators import HypervolumeCurve, ranges_of
from paretoik.front.points import ADDED_SAMPLES, SOLVERS
from paretoik.front.preferences.compromise import marked_rows
from paretoik.inputs import check_flag, file_path, shown
from paretoik.nlp.minimise import check_solver
from paretoik.nlp.program import Solver
from paretoik.pareto.placement import POINT_TOLERANCE, front_rows
from paretoik.pareto.refine import IMPROVER_OPTIONS as IMPROVER
from paretoik.pareto.refine import refine as refine_points
from paretoik.pareto.refine import suggest_points
from paretoik.pareto.scalarisation import WARM_OPTIONS as WARM_STARTS
from paretoik.pareto.scalarisation import Observe, evaluate_points
from paretoik.review.recording.messages import RecordedPoint, front_point, workcell_of
from paretoik.review.recording.recorder import Generation
from paretoik.runs.executor import check_workers
from paretoik.runs.fingerprint import check_fingerprint
from paretoik.runs.folder import check_other_folder
from paretoik.runs.interruption import check_time_limit
from paretoik.search.ask_tell import Search
from paretoik.search.endings import Progress
from paretoik.search.islands import Islands
from paretoik.stop_flag import STOP
from paretoik.trajectory.levels import on_more_samples

# The recording of a refinement: the front before and after, and the origin of each point.


class RefinementDisplay:
    """Records a front before (0 of the timeline ``refinement``) and after refinement (1)."""

    def __init__(self, session: RunSession, front: Front, problem: Any) -> None:
        self._session, self._front, self._hypervolume = session, front, HypervolumeCurve()
        session.start(
            names=front.names,
            units=front.units,
            maximised=front.maximised,
            timeline="refinement",
            workcell=workcell_of(problem),
        )
        self._record(0, front, None)

    def show(self, refined: Front) -> None:
        """Record the refined front."""
        self._record(1, refined, self._front.objectives[_rows_before(self._front, refined)])

    def _record(self, number: int, front: Front, origins: Objectives | None) -> None:
        if self._session.recorder is None:
            return
        self._session.recorder.record(
            Generation(
                number=number,
                population=self._front.objectives,
                front=front.objectives,
                front_ids=front.ids,
                hypervolume=self._hypervolume.measure(front.minimised, number),
                points=_marked(front),
                origins=origins,
            )
        )


def _marked(front: Front) -> tuple[RecordedPoint, ...]:
    """Return the best point of every objective and the compromise, with their motions."""
    if not len(front):
        return ()
    return tuple(front_point(front, row, axis=axis) for row, axis in marked_rows(front.minimised, front.ids))


def improved_points(before: Front, after: Front) -> int:
    """Return how many points of a front became better in some objective, by more than rounding."""
    gain = before.minimised[_rows_before(before, after)] - after.minimised
    rounding = indicators.OPTIONS.rounding * indicators.ranges_of(before.minimised)
    return int((gain > rounding).any(axis=1).sum()) if len(after) else 0


def _rows_before(before: Front, after: Front) -> np.ndarray:
    """Return the row of each point on the front before, found by its id."""
    rows = {int(number): row for row, number in enumerate(before.ids)}
    return np.array([rows[int(number)] for number in after.ids], dtype=int)


# Refinement of a front's points, and genes for a search.


@dataclass(frozen=True, kw_only=True)
class RefinementOptions:
    """Settings of repeated refinement.

        rounds: most rounds of refinement
        shrinkage: share of its former size below which a range requires another round
        smallest_share: smallest size of a range, as a share of its former size; less is near solver tolerances

    Criticality is measured in shares of the ranges: over the wide ranges of a coarse search it is almost zero at points
    that are not critical over the ranges of the final front.
    """

    rounds: int = 3
    shrinkage: float = 0.5
    smallest_share: float = 1e-3


OPTIONS = RefinementOptions()


def refine(
    front: Front,
    problem: Any = None,
    *,
    solver: Solver = "auto",
    out: str | Path | None = None,
    time_limit: float | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    overwrite: bool = False,
    reference: str | None = None,
    observe: Observer | bool | None = None,
) -> Front:
    """Refine every point of a front to a certified local optimum.

    Parameters
    ----------
    front
        Front to refine.
    problem
        Problem that the front solves; default: the problem that it came from.
    solver
        Solver: "interior-point" for smooth functions, "sqp" (Clarabel) for any; "auto" (default): the first if it can.
    out
        Folder for the run (default: none): run.json, front.parquet, motions.npz, review.rrd and pictures.
    time_limit
        Seconds of computing, as for ``solve``, after which refinement ends and keeps its points (default: no limit).
    workers
        Number of processes that refine and certify points, as for ``solve``.
    cluster
        Address of a Dask scheduler in place of ``workers``, as for ``solve``.
    overwrite
        Whether to replace a run in ``out`` (default False).
    reference
        Name of the problem, ``file.py:name``, kept for ``load_front``; default: what the front's own run has.
    observe
        Function called with a ``RunProgress``; default: a bar on a terminal; True: lines elsewhere too; False: nothing.

    Returns
    -------
    Front
        Front with certificates. Points keep their ids; points that another one dominates are left out.

    Raises
    ------
    InvalidInput
        If the problem is not given or has no gradients, or an objective or limit has no derivative.

    Notes
    -----
    No point becomes worse in any objective, except if limits between samples require it: then by about 1e-4 of a range,
    and no certified point. If no solver finds a better point, the point stays and its certificate says so. Refined
    motions of a ``Tracking`` have no ``genes`` (None), as genes cannot describe them.

    Ctrl-C, SIGTERM and the time limit end refinement within a second: points not refined yet stay as they were, and
    points without a certificate are "undetermined". Up to two fifths of a time limit are reserved for certificates,
    half of these for limits between samples.

    ``observe`` is called after some points are refined or certified: ``done`` of ``total``. If it returns true for
    refined points, the others stay as they are. In review.rrd the front before and after is on the timeline
    ``refinement``. Pictures are not drawn after a signal.

    In the provenance of the result ``status`` says why refinement ended, ``counts`` how many points there were, how
    many converged and how many became better; ``parent`` is the front's provenance, with the folder of its ``run``.
    """
    problem, formulation = _refinable(front, problem)
    former = {**front.provenance, **({} if front.folder is None else {"run": str(front.folder)})}
    check_time_limit(time_limit)
    with computing(time_limit):  # users' functions are traced
        check_solver(formulation.program(), solver)
    check_workers(workers, cluster)
    check_flag("overwrite", overwrite)
    if out is not None:
        check_other_folder("out", file_path("out", out), front.folder)
    reference = front.provenance.get("problem") if reference is None else reference
    with run_session(
        Subject.of(problem, reference),
        verb="refine",
        settings={"solver": solver, "time_limit": time_limit},
        out=out,
        overwrite=overwrite,
        observe=observe,
        time_limit=time_limit,
        resumable=True,
        workers=workers,
        cluster=cluster,
        source=front,
    ) as session:
        display = RefinementDisplay(session, front, problem)
        with session.computing(time_limit):
            refined = refine_front(front, problem, solver=solver, observe=session.observe or False)
        counts = {**refined.provenance["refined"], "improved": improved_points(front, refined)}
        ending = {"status": session.stopped_by or "refined", "counts": counts, "parent": former}
        ending |= {name: refined.provenance[name] for name in (SOLVERS, ADDED_SAMPLES) if name in refined.provenance}
        refined = replace(refined, provenance={**session.provenance, **ending})
        session.finish(refined)
        with session.reviewing():
            display.show(refined)
            review_front(refined, session)
    return refined


Complete: TypeAlias = Callable[
    [Differentiable, Points, Ids, Float[np.ndarray, " n_obj"], Observer | None, LaterTime],
    tuple[Points, Ids, Float[np.ndarray, " n_obj"]],
]
"""Function of formulation, points, ids, ranges, observer and times: returns completed points, ids and ranges."""


def refine_front(
    front: Front,
    problem: Any,
    *,
    solver: Solver,
    observe: Observer | bool | None,
    complete: Complete | None = None,
) -> Front:
    """Return a front refined and certified as by ``refine``, its points completed by ``complete``, if given."""
    problem, formulation = _refinable(front, problem)
    with verb_session(observe) as session:
        x, ranges = formulation.front_points(front), ranges_of(front.minimised)
        check_solver(formulation.program(ranges), solver)
        if len(x) and not (evaluate_points(formulation.program(ranges), x).violation <= WARM_STARTS.violation).any():
            ProblemParts(problem).require_feasible()
        refined = _refine_and_certify(
            problem, x, front.ids, ranges, front.provenance, solver, session.observe, before=front, complete=complete
        )
        if not refined.ended:
            refined = _resolve(refined, front, solver, session.observe)
        converged = int(refined.converged.sum())
        counts = {"points": len(front), "converged": converged, "seconds": round(session.seconds, 3)}
        status = {} if session.signal is None else {"status": session.signal}
        return replace(refined.front, provenance={**refined.front.provenance, "refined": counts, **status})


class _Refined(NamedTuple):
    """A refined and certified front, which points converged, and whether an observer ended it."""

    front: Front
    converged: Bool[np.ndarray, " points"]
    ended: bool


def _refine_and_certify(
    problem: Any,
    x: Points,
    ids: Ids,
    ranges: Values,
    provenance: Mapping[str, Any],
    solver: Solver,
    observe: Observer | None,
    *,
    before: Front | None = None,
    complete: Complete | None = None,
) -> _Refined:
    """Return the refined and certified front of points, completed by ``complete``, if given."""
    formulation: Differentiable = problem
    later = LaterTime(formulation=formulation, solver=solver)
    count = partial(_count_round, observe, problem, later, ranges, "" if complete is None else "optimum")
    with LaterStages.of(problem).reserve(len(x)):
        x, converged, ranges, ended = _refine_over_own_ranges(formulation, x, ranges, solver, count)
        if complete is not None:
            assert before is not None
            individuals = no_worse(formulation, formulation.individuals(x), before, ranges)
            x, ids, ranges = complete(formulation, individuals.x, ids, ranges, observe, later)
    front = certified_front(
        problem,
        formulation,
        x,
        ids,
        ranges,
        dict(provenance),
        before=before if complete is None else None,
        solver=solver,
        observe=observe,
        later=later,
    )
    return _Refined(front, converged, ended)


def resolve_front(front: Front, solver: Solver, observe: Observer | None) -> Front:
    """Return a certified front, on more samples if a value is under-resolved (``on_more_samples``).

    All points are refined and certified again on these samples. The front stays as it is if one of its points leaves
    the path between samples.
    """
    return _resolve(_Refined(front, np.zeros(0, dtype=bool), False), None, solver, observe).front


def _resolve(refined: _Refined, before: Front | None, solver: Solver, observe: Observer | None) -> _Refined:
    """Return the result of ``resolve_front``; points that were better on the front ``before`` start from there."""

    def refine(coarse: _Refined) -> _Refined | None:
        front = coarse.front
        problem = front.problem.with_midpoints()
        x = _curves_at_samples(front, before, problem)
        show = None if observe is None else partial(_show_samples, observe, len(problem.task.times))
        ranges = ranges_of(front.minimised)
        finer = _refine_and_certify(problem, x, front.ids, ranges, front.provenance, solver, show)
        return None if finer.ended else finer

    return on_more_samples(refined, lambda coarse: _largest_error(coarse.front), refine)


def _largest_error(front: Front) -> float:
    """Return the largest error of a value of the under-resolved points, as a share of its objective's range."""
    assert front.certificates is not None
    errors = front.certificates.discretisation_error[front.certificates.status == "under-resolved"]
    return float((errors / ranges_of(front.minimised)).max(initial=0.0))


def _curves_at_samples(front: Front, before: Front | None, problem: Any) -> Points:
    """Return the curves of a front as points of a problem on more samples.

    Curves that are worse there than on the front ``before`` are replaced by those of that front. Raises Infeasible if a
    curve of the front leaves the path.
    """
    motions: Any = front.motions
    x: Points = motions.at(problem.task.times)
    if before is not None and before.motions is not None:
        _, rows, rows_before = np.intersect1d(front.ids, before.ids, return_indices=True)
        curves = problem.curve_points(before.motions[rows_before])
        on_path = np.isfinite(curves).all(axis=(1, 2))
        rows, curves = rows[on_path], curves[on_path]
        now, former = (evaluate_points(problem.program(), each) for each in (x[rows], curves))
        rise = (now.objectives - former.objectives)[:, : len(front.names)] / ranges_of(front.minimised)
        better = (former.violation <= WARM_STARTS.violation) & (rise > CERTIFIED.tolerance).any(axis=1)
        x[rows[better]] = curves[better]
    return x


def _show_samples(observe: Observer, samples: int, progress: RunProgress) -> object:
    """Show an observer progress with the number of samples."""
    return observe(replace(progress, summary=", ".join(filter(None, (f"on {samples} samples", progress.summary)))))


def _count_round(
    observe: Observer | None, problem: Any, later: LaterTime, ranges: Values, then: str, number: int
) -> Observe | None:
    """Return a function that shows an observer how many points of a round are refined.

    It does not show the time left if other stages come first, ``then``.
    """
    show = count_observer(
        observe,
        "refinement",
        later=later.per_point,
        uniform=not then,
        then=then,
        following=LaterStages.of(problem).text,
    )
    words, began = f"round {number + 1}" if number else "", computing_clock()

    def show_point(done: int, total: int, x: Point) -> object:
        assert show is not None
        if not then and getattr(observe, "is_due", True):
            later.try_point(x, ranges, computing_clock() - began)
        return show(done, total, words)

    return None if show is None else show_point


def _refine_over_own_ranges(
    formulation: Differentiable,
    x: Points,
    ranges: Values,
    solver: Solver,
    count: Callable[[int], Observe | None],
) -> tuple[Points, Bool[np.ndarray, " points"], Values, bool]:
    """Return refined points, which of them converged, their ranges, and whether an observer ended it.

    The ranges are about those of the points' front. ``count`` returns the observer of each round.
    """
    ended = False

    def show(done: int, total: int, x: Point) -> object:
        nonlocal ended
        ended = bool(observe is not None and observe(done, total, x))
        return ended

    first, shares = ranges, np.ones(len(ranges))
    for number in range(OPTIONS.rounds):
        observe, program, before = count(number), formulation.program(first * shares), shares
        x, converged = refine_points(program, x, len(ranges), solver=solver, observe=show)
        values = evaluate_points(program, x).objectives[:, : len(ranges)] * before
        widths = np.ptp(values[front_rows(values)], axis=0)
        shares = np.where(widths > POINT_TOLERANCE, np.maximum(widths, OPTIONS.smallest_share), before)
        if ended or STOP[0] or (shares > OPTIONS.shrinkage * before).all():
            break
    return x, converged, first * before, ended


def _refinable(front: Front, problem: Any) -> tuple[Any, Differentiable]:
    """Return the problem of a front with its gradients; raises InvalidInput if it has none."""
    if not isinstance(front, Front):
        raise InvalidInput(f"front must be a Front, got {shown(front)}")
    problem = front.problem if problem is None else problem
    if problem is None:
        raise InvalidInput("front must come with its problem, got none; refine(front, problem) gives it")
    formulation = require_program("refine", problem)
    _check_front(front, formulation, problem)
    problem = at_samples_of(problem, getattr(front.motions, "q", None))
    return problem, require_program("refine", problem)


def _check_front(front: Front, formulation: Differentiable, problem: Any) -> None:
    if tuple(formulation.names) != tuple(front.names):
        raise InvalidInput(f"problem must have the objectives {', '.join(front.names)}, got others")
    stored = front.provenance.get("fingerprint")
    if stored is not None:
        check_fingerprint(problem, stored, wish="problem must be the one that the front solves")


class SearchImprover:
    """Suggests genes to a search: points that a few iterations lead to from its front.

    ``spent`` counts iterations, each as one evaluation. Raises InvalidInput if the problem has no gradients, or an
    objective or limit has no derivative.
    """

    def __init__(self, search: Search | Islands, solver: Solver = "auto") -> None:
        self.spent = 0
        self._search, self._solver = search, solver
        self._formulation = require_program("refine", search.problem)
        self._program = self._formulation.program()

    def __call__(self, progress: Progress) -> Genes | None:
        """Return genes to evaluate next, or None."""
        front = self._search.archive.members
        due = progress.generation % IMPROVER.every == 0 and self.spent <= IMPROVER.share * progress.evaluations
        if not due or front is None or len(front) < 2:
            return None
        x = self._formulation.points(front.X)
        x, iterations = suggest_points(self._program, x, front.F, self._formulation.branches(x), solver=self._solver)
        self.spent += iterations
        return self._formulation.genes(x)

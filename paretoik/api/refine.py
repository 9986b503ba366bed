"""Refine every point of a front to a certified local optimum, and suggest genes to a search."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.api.certified_front import OPTIONS as CERTIFIED
from paretoik.api.certified_front import LaterTime, certified_front, later_stages, no_worse, reserve_later
from paretoik.api.progress import Observer, RunProgress, count_observer
from paretoik.api.session import RunRequest, Session, Subject, computing, open_session
from paretoik.arrays import Genes, Ids, Objectives, Point, Points, Values
from paretoik.compilation_notices import computing_clock
from paretoik.errors import Infeasible, InvalidInput, SolverFailed
from paretoik.formulations.protocol import Differentiable, ProblemParts, at_samples_of, require_program
from paretoik.front import indicators
from paretoik.front.front import Front
from paretoik.front.indicators import HypervolumeCurve, ranges_of
from paretoik.front.points import ADDED_SAMPLES, SOLVERS
from paretoik.front.preferences.compromise import marked_rows
from paretoik.inputs import check_flag, file_path, shown
from paretoik.nlp.minimise import check_solver
from paretoik.nlp.program import Solver
from paretoik.pareto.epsilon import epsilon_points
from paretoik.pareto.placement import POINT_TOLERANCE, front_rows
from paretoik.pareto.refine import IMPROVER_OPTIONS as IMPROVER
from paretoik.pareto.refine import refine as refine_points
from paretoik.pareto.refine import suggest_points
from paretoik.pareto.scalarisation import WARM_OPTIONS as WARM_STARTS
from paretoik.pareto.scalarisation import evaluate_points
from paretoik.pareto.sweep import SweepProgress
from paretoik.review.recording.messages import front_point
from paretoik.review.recording.recorder import Generation
from paretoik.runs.executor import check_workers
from paretoik.runs.fingerprint import check_fingerprint
from paretoik.runs.folder import check_other_folder
from paretoik.search.ask_tell import Search
from paretoik.search.endings import Progress
from paretoik.search.islands import Islands
from paretoik.stop_flag import STOP, Interrupted, check_interruption
from paretoik.trajectory.levels import on_more_samples


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
    problem = _refinable(front, problem)
    former = {**front.provenance, **({} if front.folder is None else {"run": str(front.folder)})}
    with computing(time_limit):  # users' functions are traced
        check_solver(problem.program(), solver)
    check_workers(workers, cluster)
    check_flag("overwrite", overwrite)
    if out is not None:
        check_other_folder("out", file_path("out", out), front.folder)
    reference = front.provenance.get("problem") if reference is None else reference
    request = RunRequest(
        verb="refine",
        subject=Subject.of(problem, reference),
        settings={"solver": solver, "time_limit": time_limit},
        out=out,
        overwrite=overwrite,
        observe=observe,
        time_limit=time_limit,
        workers=workers,
        cluster=cluster,
        resumable=True,
        source=front,
    )
    with open_session(request) as session:
        session.record_search(front, "refinement", problem)
        record = partial(_record, session, HypervolumeCurve(), front)
        record(0, front)
        with computing(time_limit, session):
            refined = refine_front(front, problem, solver=solver, observe=session.observe)
        rows_before = {int(number): row for row, number in enumerate(front.ids)}
        before = np.array([rows_before[int(number)] for number in refined.ids], dtype=int)
        gain = front.minimised[before] - refined.minimised
        rounding = indicators.OPTIONS.rounding * ranges_of(front.minimised)
        improved = int((gain > rounding).any(axis=1).sum()) if len(refined) else 0
        counts = {**refined.provenance["refined"], "improved": improved}
        ending = {"status": session.stopped_by or "refined", "counts": counts, "parent": former}
        ending |= {name: refined.provenance[name] for name in (SOLVERS, ADDED_SAMPLES) if name in refined.provenance}
        refined = replace(refined, provenance={**session.provenance, **ending})
        session.finish_front(refined, partial(record, 1, refined, front.objectives[before]))
    return refined


def _record(
    session: Session,
    curve: HypervolumeCurve,
    before: Front,
    number: int,
    front: Front,
    origins: Objectives | None = None,
) -> None:
    """Record the front before refinement (0) or after it (1), which has ``origins`` on the front before."""
    if session.recorder is None:
        return
    marked = marked_rows(front.minimised, front.ids) if len(front) else ()  # best of every objective, compromise
    session.record(
        Generation(
            number=number,
            population=before.objectives,
            front=front.objectives,
            front_ids=front.ids,
            hypervolume=curve.measure(front.minimised, number),
            points=tuple(front_point(front, row, axis=axis) for row, axis in marked),
            origins=origins,
        )
    )


# Refinement and completion of a front's points.


@dataclass(frozen=True, kw_only=True)
class Completion:
    """Points that are added to a refined front: the best that ``plan`` finds, and those that gain most in gaps.

    points: most points of the front, or its own number if that is larger
    seed: seed of the starts
    first_id: id of the first new point
    starts: number of starts per objective; fewer than without a search, as the search has looked already
    cold_points: number of points that are also sought from starts
    """

    points: int
    seed: int
    first_id: int
    starts: int = 24
    cold_points: int = 0


def refine_front(
    front: Front, problem: Any, *, solver: Solver, observe: Observer | None, completion: Completion | None = None
) -> Front:
    """Return a front refined and certified as by ``refine``, with the points of a ``completion``, if given."""
    formulation: Differentiable = problem
    began = time.monotonic()
    x, ranges = formulation.front_points(front), ranges_of(front.minimised)
    check_solver(formulation.program(ranges), solver)
    if len(x) and not (evaluate_points(formulation.program(ranges), x).violation <= WARM_STARTS.violation).any():
        ProblemParts(problem).require_feasible()
    refined = _refine_and_certify(
        problem, x, front.ids, ranges, front.provenance, solver, observe, before=front, completion=completion
    )
    if not refined.ended:
        refined = _resolve(refined, front, solver, observe)
    seconds = round(time.monotonic() - began, 3)
    counts = {"points": len(front), "converged": int(refined.converged.sum()), "seconds": seconds}
    return replace(refined.front, provenance={**refined.front.provenance, "refined": counts})


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
    completion: Completion | None = None,
) -> _Refined:
    """Return the refined and certified front of points, with those of a ``completion``, if given."""
    formulation: Differentiable = problem
    later = LaterTime(formulation=formulation, solver=solver)
    then = "" if completion is None else "optimum"
    with reserve_later(len(x), len(later_stages(problem))):
        x, converged, ranges, ended = _refine_over_own_ranges(later, x, ranges, observe, then)
        if completion is not None:
            assert before is not None
            x = no_worse(formulation, formulation.individuals(x), before, ranges).x
            before = None
            if len(ranges) > 1 and len(x):
                x, ids, ranges = _completed(completion, later, x, ids, ranges, observe)
    front = certified_front(
        problem, x, ids, ranges, provenance, before=before, solver=solver, observe=observe, later=later
    )
    return _Refined(front, converged, ended)


def _completed(
    completion: Completion, later: LaterTime, x: Points, ids: Ids, ranges: Values, observe: Observer | None
) -> tuple[Float[np.ndarray, " completed *point"], Int[np.ndarray, " completed"], Values]:
    """Return points with those of a completion, their ids and ranges; as they are if the planner finds nothing."""
    formulation, solver, began = later.formulation, later.solver, computing_clock()

    def show_point(progress: SweepProgress) -> object:
        assert observe is not None
        is_due = getattr(observe, "is_due", True)
        return observe(later.point_progress(progress, computing_clock() - began, is_due=is_due))

    with suppress(Infeasible, SolverFailed, Interrupted):
        check_interruption()
        shown = count_observer(observe, "optimum")
        cold = formulation.cold_search(starts=completion.starts, seed=completion.seed, solver=solver, observe=shown)
        began = computing_clock()
        new, new_ranges = epsilon_points(
            formulation.program,
            cold,
            len(ranges),
            points=max(completion.points, 2),
            initial=x,
            refined=True,
            cold_points=completion.cold_points,
            solver=solver,
            observe=None if observe is None else show_point,
        )
        # Former points keep their ids, new ones count from the first id.
        ids_before = {one.tobytes(): int(each) for one, each in zip(x, ids, strict=True)}
        numbers = [ids_before.get(one.tobytes(), completion.first_id + i) for i, one in enumerate(new)]
        return new, np.array(numbers, dtype=np.int64), new_ranges
    return x, ids, ranges


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

    def largest_error(coarse: _Refined) -> float:
        """Return the largest error of under-resolved values, as a share of their objective's range."""
        certificates = coarse.front.certificates
        assert certificates is not None
        errors = certificates.discretisation_error[certificates.status == "under-resolved"]
        return float((errors / ranges_of(coarse.front.minimised)).max(initial=0.0))

    return on_more_samples(refined, largest_error, refine)


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


def _refine_over_own_ranges(
    later: LaterTime, x: Points, ranges: Values, observe: Observer | None, then: str
) -> tuple[Points, Bool[np.ndarray, " points"], Values, bool]:
    """Return refined points, which of them converged, their ranges, and whether an observer ended it.

    The ranges are about those of the points' front. The time left is not shown if other stages come first, ``then``.
    """
    formulation, following = later.formulation, " and ".join(later_stages(later.formulation))
    ended, shares = False, np.ones(len(ranges))

    def show(done: int, total: int, point: Point) -> object:
        nonlocal ended
        if count is not None:
            if not then and getattr(observe, "is_due", True):
                later.try_point(point, ranges, computing_clock() - began)
            ended = bool(count(done, total, words))
        return ended

    for number in range(OPTIONS.rounds):
        words = f"round {number + 1}" if number else ""
        count = count_observer(
            observe, "refinement", later=later.per_point, uniform=not then, then=then, following=following
        )
        program, before, began = formulation.program(ranges * shares), shares, computing_clock()
        x, converged = refine_points(program, x, len(ranges), solver=later.solver, observe=show)
        values = evaluate_points(program, x).objectives[:, : len(ranges)] * before
        widths = np.ptp(values[front_rows(values)], axis=0)
        shares = np.where(widths > POINT_TOLERANCE, np.maximum(widths, OPTIONS.smallest_share), before)
        if ended or STOP[0] or (shares > OPTIONS.shrinkage * before).all():
            break
    return x, converged, ranges * before, ended


def _refinable(front: Front, problem: Any) -> Any:
    """Return the problem of a front; raises InvalidInput if it has no gradients or is another one."""
    if not isinstance(front, Front):
        raise InvalidInput(f"front must be a Front, got {shown(front)}")
    problem = front.problem if problem is None else problem
    if problem is None:
        raise InvalidInput("front must come with its problem, got none; refine(front, problem) gives it")
    if tuple(require_program("refine", problem).names) != tuple(front.names):
        raise InvalidInput(f"problem must have the objectives {', '.join(front.names)}, got others")
    stored = front.provenance.get("fingerprint")
    if stored is not None:
        check_fingerprint(problem, stored, wish="problem must be the one that the front solves")
    return at_samples_of(problem, getattr(front.motions, "q", None))


# Genes for a search.


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

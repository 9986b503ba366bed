"""Refine every point of a front to a certified local optimum."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.api.session import RunRequest, Session, computing, open_session, surroundings
from paretoik.arrays import Objectives
from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import ProblemParts, at_samples_of, require_program
from paretoik.front import hypervolume as indicators
from paretoik.front.front import Front
from paretoik.front.hypervolume import HypervolumeCurve, ranges_of
from paretoik.front.points import ADDED_SAMPLES, SOLVERS
from paretoik.front.preferences.knee_and_compromise import marked_rows
from paretoik.inputs import file_path, shown
from paretoik.nlp.minimise import check_solver
from paretoik.nlp.program import FEASIBLE, Solver
from paretoik.pareto.certified_front import OPTIONS as CERTIFIED
from paretoik.pareto.certified_front import Certifier
from paretoik.pareto.refined_front import Completion, RefinedFront, refined_front
from paretoik.pareto.scalarisation import evaluate_points
from paretoik.progress import Observer, RunProgress
from paretoik.review.recording.messages import front_point
from paretoik.review.recording.recorder import Generation
from paretoik.runs.fingerprint import check_fingerprint
from paretoik.runs.folder import check_other_folder
from paretoik.trajectory.levels import on_more_samples


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
        Solver: "interior-point" (smooth functions), "sqp" (any, by Clarabel); "auto" (default): the first if possible.
    out
        Folder for the run (default: none): run.json, front.parquet, motions.npz, review.rrd and pictures.
    time_limit
        Computing time [s], as for ``solve``, after which refinement ends and keeps its points (default: no limit).
    workers
        Number of processes that refine and certify points, as for ``solve``.
    cluster
        Address of a Dask scheduler in place of ``workers``, as for ``solve``.
    overwrite
        Whether to replace a run in ``out`` (default False).
    reference
        Name of the problem, ``file.py:name``, kept for ``load_front``; default: that of the front's own run.
    observe
        Function called with a ``RunProgress``; default: a bar on a terminal; True: lines elsewhere too; False: nothing.

    Returns
    -------
    Front
        Front with certificates. Points keep their ids; dominated points are left out.

    Raises
    ------
    InvalidInput
        If the problem is not given or has no gradients, or an objective or limit has no derivative.

    Notes
    -----
    No certified point becomes worse in any objective. Other points may become worse by about 1e-4 of a range if limits
    between samples require it. If no solver finds a better point, the point stays and its certificate says so. Refined
    motions of a ``Tracking`` have no ``genes`` (None), as genes cannot describe them.

    Ctrl-C, SIGTERM and the time limit end refinement within a second: points not refined yet stay as they were, and
    points without a certificate are "undetermined". Up to two fifths of a time limit are reserved for certificates,
    half of this time for limits between samples.

    ``observe`` is called after some points are refined or certified: ``done`` of ``total``. If it returns a true value
    during refinement, the remaining points stay as they are. In review.rrd the front before and after is on the
    timeline ``refinement``. Pictures are not drawn after a signal.

    In the provenance of the result ``status`` says why refinement ended, ``counts`` how many points there were, how
    many converged and how many became better; ``parent`` is the front's provenance, with the folder of its ``run``.
    """
    if not isinstance(front, Front):
        raise InvalidInput(f"front must be a Front, got {shown(front)}")
    problem = front.problem if problem is None else problem
    if problem is None:
        raise InvalidInput("front must come with its problem, got none; pass it: refine(front, problem)")
    if tuple(require_program("refine", problem).names) != tuple(front.names):
        got = ", ".join(require_program("refine", problem).names)
        raise InvalidInput(f"problem must have the objectives {', '.join(front.names)}, got {got}")
    stored = front.provenance.get("fingerprint")
    if stored is not None:
        check_fingerprint(problem, stored, wish="problem must be the one that the front solves")
    problem = at_samples_of(problem, getattr(front.motions, "q", None))
    reference = front.provenance.get("problem") if reference is None else reference
    given = surroundings(locals())
    former = {**front.provenance, **({} if front.folder is None else {"run": str(front.folder)})}
    if out is not None:
        check_other_folder("out", file_path("out", out), front.folder)
    request = RunRequest(
        verb="refine",
        problem=problem,
        settings={"solver": solver, "time_limit": time_limit},
        resumable=True,
        source=replace(front, provenance=former),
        **given,
    )
    with computing(time_limit):  # users' functions are traced
        check_solver(problem.program(), solver)
    with open_session(request) as session:
        session.record_search(front, "refinement")
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
    """Record the front before refinement (0) or after it (1); ``origins``: objectives of its points before."""
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


# Refinement of a front, on more samples if a value is under-resolved (``on_more_samples``).


def refine_front(
    front: Front, problem: Any, *, solver: Solver, observe: Observer | None, completion: Completion | None = None
) -> Front:
    """Return a front refined and certified as by ``refine``; ``completion`` adds points to it, if given."""
    certifier = Certifier(formulation=problem, solver=solver, observe=observe)
    formulation, began = certifier.formulation, time.monotonic()
    x, ranges = formulation.front_points(front), ranges_of(front.minimised)
    check_solver(formulation.program(ranges), solver)
    if len(x) and not (evaluate_points(formulation.program(ranges), x).violation <= FEASIBLE).any():
        ProblemParts(problem).require_feasible()
    refined = refined_front(certifier, x, front.ids, ranges, front.provenance, before=front, completion=completion)
    if not refined.ended:
        refined = resolve_front(refined, certifier, before=front)
    seconds = round(time.monotonic() - began, 3)
    counts = {"points": len(front), "converged": int(refined.converged.sum()), "seconds": seconds}
    return replace(refined.front, provenance={**refined.front.provenance, "refined": counts})


def resolve_front(refined: RefinedFront, certifier: Certifier, before: Front | None = None) -> RefinedFront:
    """Return a certified front, on more samples if a value is under-resolved.

    All points are refined and certified again on these samples; points that were better on the front ``before`` start
    from there. The front stays as it is if one of its points leaves the path between samples.
    """
    observe = certifier.observe

    def refine(coarse: RefinedFront) -> RefinedFront | None:
        front = coarse.front
        problem: Any = front.problem.with_midpoints()
        samples = f"on {len(problem.task.times)} samples"

        def show(progress: RunProgress) -> object:
            assert observe is not None
            return observe(replace(progress, summary=", ".join(filter(None, (samples, progress.summary)))))

        motions: Any = front.motions
        x, ranges = motions.at(problem.task.times), ranges_of(front.minimised)
        if before is not None and before.motions is not None:  # the curve before, if it is better on these samples
            _, rows, rows_before = np.intersect1d(front.ids, before.ids, return_indices=True)
            curves = problem.curve_points(before.motions[rows_before])
            on_path = np.isfinite(curves).all(axis=(1, 2))
            rows, curves = rows[on_path], curves[on_path]
            now, former = (evaluate_points(problem.program(), each) for each in (x[rows], curves))
            rise = (now.objectives - former.objectives)[:, : len(front.names)] / ranges
            better = (former.violation <= FEASIBLE) & (rise > CERTIFIED.tolerance).any(axis=1)
            x[rows[better]] = curves[better]
        shown = None if observe is None else show
        finer = refined_front(
            Certifier(formulation=problem, solver=certifier.solver, observe=shown),
            x,
            front.ids,
            ranges,
            front.provenance,
        )
        return None if finer.ended else finer

    def errors(coarse: RefinedFront) -> Float[np.ndarray, " points"]:
        """Return the errors of under-resolved points, relative to the objectives' ranges."""
        certificates = coarse.front.certificates
        assert certificates is not None
        inexact = certificates.discretisation_error[certificates.status == "under-resolved"]
        return (inexact / ranges_of(coarse.front.minimised)).max(axis=1)

    return on_more_samples(refined, errors, refine)

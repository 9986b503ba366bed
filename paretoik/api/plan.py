"""Plan one objective: all distinct locally optimal motions of a ``Tracking`` problem."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.initial import remembered_initial
from paretoik.api.result import limit_words, save_plan
from paretoik.api.session import RunRequest, Session, computing, open_session, surroundings
from paretoik.formulations.protocol import require_plan
from paretoik.inputs import check_count, check_seed
from paretoik.nlp.minimise import check_solver
from paretoik.nlp.program import Solver, check_solver_name
from paretoik.progress import Observer, count_observer
from paretoik.review.palette import objective_label
from paretoik.review.recording.messages import (
    LeastViolating,
    PlanEnd,
    PlannedLevel,
    PlannedMotions,
    PlannedOptimum,
    PlannedScene,
    RecordedPoint,
    record_motion,
    workcell_of,
)
from paretoik.runs.files import DRAWING
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.levels import OPTIONS, LevelProgress
from paretoik.trajectory.motion_terms import joint_distance
from paretoik.trajectory.plan import Plan


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
    """Return all distinct locally optimal motions of a ``Tracking`` problem.

    Parameters
    ----------
    problem
        ``Tracking`` with one integral objective.
    starts
        Number of starts per redundant degree; by default up to 48, until a better optimum is unlikely.
    seed
        Seed of the starts (default 0); the same seed gives the same plan.
    initial
        Motions on the problem's path, as further starts.
    solver
        Solver: "interior-point" (smooth functions), "sqp" (any, by Clarabel); "auto" (default): the first if possible.
    out
        Folder for the run (default: none): run.json, optima.parquet, motions.npz, review.rrd and picture.png.
    time_limit
        Computing time [s], as for ``solve``, after which the search ends and keeps its optima (default: no limit).
    workers
        Number of processes that solve starts, as for ``solve``.
    cluster
        Address of a Dask scheduler in place of ``workers``, as for ``solve``.
    overwrite
        Whether to replace a run in ``out`` (default False).
    reference
        Name of the problem, ``file.py:name``, kept in the run for ``load_plan``.
    observe
        Function called with a ``RunProgress``; default: a bar on a terminal; True: lines elsewhere too; False: nothing.

    Returns
    -------
    Plan
        Plan with the ``optima`` that its starts led to, best first; ``best`` is the first of them.

    Raises
    ------
    InvalidInput
        If an argument cannot be used, such as several objectives or one without a derivative.
    OutOfReach
        If the path leaves the reach of the arm.
    Infeasible
        If no motion satisfies the limits; the error has the least-violating motion and the binding limit.
    SolverFailed
        If no feasible motion could be made optimal, or none was found within the time limit.

    Notes
    -----
    "Optimum" is meant locally. By default more starts are tried if functions have no kinks, peaks or whole-motion
    parts. With one redundant degree, about three times as many are tried while some optimum was reached from only one
    or two; if optima remain rare or are many, paths through a grid of postures are tried too. With more degrees, if
    optima are rare, starts near the best optimum are tried while they lead to better ones.

    Ctrl-C, SIGTERM and the time limit end the search within a second. The optima so far are returned, if necessary
    those on coarser samples, with status "interrupted". ``plan.provenance["status"]`` says why the search ended.

    ``observe`` is called after every level of samples, coarse to fine: ``done`` of all samples. ``load_plan`` opens the
    folder. review.rrd has every start, its end point, and the optima. The picture is not drawn after a signal.

    Source: Tringali & Cocuzza 2020, section 3.1.

    Examples
    --------
    >>> import paretoik as pk
    >>> path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=51)
    >>> optima = plan(pk.Tracking(pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy]), starts=24)
    >>> round(optima.best.objective, 3)
    0.038
    """
    given = surroundings(locals())
    check_count("starts", starts)
    check_seed("seed", seed)
    check_solver_name(solver)
    find_optima = require_plan(problem)
    settings = {"starts": starts, "seed": seed, "initial": initial is not None, "solver": solver}
    request = RunRequest(
        verb="plan",
        problem=problem,
        settings={**settings, "time_limit": time_limit},
        resumable=True,
        **given,
    )
    if solver != "auto":  # "auto" chooses a solver, from values before derivatives
        with computing(time_limit):  # users' functions are traced
            check_solver(problem.program(), solver)
    (name,), (unit,), (maximised,) = problem.names, problem.units, map(bool, problem.maximised)
    with open_session(request) as session:
        given_q = problem.motion_points(initial) if isinstance(initial, Motion) else None
        stored = remembered_initial(q=given_q).get("q")
        initial = problem.task.motion(stored) if initial is None and stored is not None else initial
        levels, cell = list[PlannedLevel](), workcell_of(problem)
        assert cell is not None
        session.start_recording(PlannedScene(name=name, unit=unit, maximised=maximised, workcell=cell))
        show = _level_observer(session, problem.task, levels)
        with computing(time_limit, session):
            plan = find_optima(starts=starts, seed=seed, initial=initial, solver=solver, observe=show)
        ending = session.ended(session.stopped_by or "optima", optima=len(plan.optima), starts=plan.starts)
        plan = replace(plan, provenance={**ending, **plan.provenance})

        def draw(folder: Path) -> None:
            from paretoik.review.pictures.motions import plan_picture  # here: matplotlib loads slowly

            plan_picture(plan, levels, objective_label(name, unit, maximised), unit, folder / DRAWING)

        session.finish(
            plan,
            partial(save_plan, plan, name=name, unit=unit, maximised=maximised),
            status=plan.provenance["status"],
            end=partial(_plan_end, plan),
            draw=draw,
        )
    return plan


def _level_observer(session: Session, task: MotionTask, levels: list[PlannedLevel]) -> Callable[[LevelProgress], None]:
    """Return a function that shows a level and appends it to ``levels``."""
    show = count_observer(session.observe, "sample")

    def show_level(level: LevelProgress) -> None:
        if session.folder is not None:
            levels.append(_planned_level(len(levels), level))
            session.record(levels[-1])
        if show is not None:
            broken = level.describe_violation(task) or f"{len(level.optima)} distinct optima"
            show(level.samples, max(level.samples, len(task.times)), f"{len(level.starts)} starts, {broken}")

    return show_level


def _planned_level(number: int, level: LevelProgress) -> PlannedLevel:
    """Return a level for drawing."""
    (objective,), task = level.task.objectives, level.task
    motions = level.starts, level.ends, level.optima
    starts, ends, optima = (np.asarray(objective(task.motion(q)), dtype=float) for q in motions)
    nearest = np.full(len(level.ends), -1)  # index of the optimum that each start led to, −1 for none
    if len(level.optima):
        distance = np.stack([joint_distance(task, level.ends, optimum) for optimum in level.optima], axis=1)
        near = level.converged & (distance.min(axis=1) <= OPTIONS.distinct)
        nearest = np.where(near, distance.argmin(axis=1), -1)
    broken = None if level.feasible else LeastViolating(broken=limit_words(task, task.motion(level.optima[0])))
    return PlannedLevel(
        number=number,
        samples=level.samples,
        starts=starts,
        ends=np.where(level.converged, ends, np.nan),
        optima=optima,
        motions=PlannedMotions(
            time=np.array(task.times), starts=level.starts, ends=level.ends, optima=level.optima, optimum=nearest
        ),
        least_violating=broken,
    )


def _plan_end(plan: Plan) -> PlanEnd:
    """Return the optima for drawing."""
    optima = []
    for place, each in enumerate(plan.optima):
        motion, between = record_motion(each.motion, curves=True), float(each.violation_between)
        point = RecordedPoint(id=place, objectives=np.array([each.objective]), motion=motion)
        optima.append(PlannedOptimum(point=point, branch=each.label, status=each.status, violation_between=between))
    return PlanEnd(optima=optima, provenance=dict(plan.provenance))

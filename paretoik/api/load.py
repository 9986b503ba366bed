"""Load the front or the plan of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from paretoik.api.result import read_plan
from paretoik.errors import EvaluationFailed, InvalidInput, InvalidRun, SolverFailed, warn_user
from paretoik.file_paths import shell_command
from paretoik.formulations.motions import motions_of_task, restore_motions
from paretoik.formulations.protocol import at_samples_of, timeline
from paretoik.front.front import Front
from paretoik.front.points import attach
from paretoik.inputs import CALLS, file_path, shown
from paretoik.loading import load_problem
from paretoik.runs.files import MOTIONS, problem_words
from paretoik.runs.fingerprint import check_fingerprint
from paretoik.runs.interruption import TimeLimit, check_time_limit, limited_evaluations
from paretoik.stop_flag import Interrupted
from paretoik.trajectory.plan import Optimum, Plan

# The problem of a stored run, which the user must name (problem=, --problem, or yes to the question). Loading a problem
# runs its file, and a run folder may come from anybody, so the file that the run names is never run unasked.


def named_problem(problem: Any, *, time_limit: float | None = None, evaluation_timeout: float | None = None) -> Any:
    """Return ``problem`` itself, or the problem that it names if it is text.

    problem: problem, its name or None; for a polygon its arm
    time_limit: longest time to load the problem [s]
    evaluation_timeout: longest call of a user's function [s]

    Raises InvalidInput for other objects, and as ``load_problem`` does; SolverFailed if loading exceeds
    ``time_limit``; EvaluationFailed if several calls exceed ``evaluation_timeout``.
    """
    timeline(problem)  # refuses objects whose attributes cannot be read
    is_problem = not isinstance(problem, type) and (hasattr(problem, "n_obj") or hasattr(problem, "dof"))
    if problem is not None and not isinstance(problem, str) and not is_problem:
        raise InvalidInput(f"problem must be a problem or FILE.py:NAME, got {shown(problem)}")
    if not isinstance(problem, str):
        return problem
    check_time_limit(time_limit)
    limit = TimeLimit(seconds=time_limit)
    try:
        with limit.limiting_calls(), limited_evaluations(evaluation_timeout, allowed=CALLS.allowed):
            return load_problem(problem)
    except Interrupted as stop:
        if not stop.reason:
            raise
        if not limit.reached:
            raise EvaluationFailed(f"no problem was built: {stop.reason}, {CALLS.allowed + 1} times") from None
        raise SolverFailed(f"time_limit: no problem was built within {time_limit:g} s; {stop.reason}") from None


def how_to_name(reference: object) -> str:
    """Return a hint how to name the problem of a run. ``reference``: name that the run stored."""
    words = problem_words(reference)
    if not words:
        return "the run names none; give it by problem= or --problem FILE.py:NAME"
    return f"its file is run only if you name it: problem=, or {shell_command(*words)}"


# The plan of a run.


def load_plan(folder: str | Path, problem: Any = None) -> Plan:
    """Return the plan of a run folder.

    Parameters
    ----------
    folder
        Folder of a run of ``plan``.
    problem
        Problem that was planned, or its name, "FILE.py:NAME", whose file is run; always required.

    Returns
    -------
    Plan
        Plan, its motions with the arm of ``problem``.

    Raises
    ------
    InvalidRun
        If the folder contains no run of ``plan``, or a damaged one, or its motions are not on the problem's path.
    InvalidInput
        If no problem is given, or another one than was planned.
    """
    folder, problem = file_path("folder", folder), named_problem(problem)
    run, columns, stored = read_plan(folder)
    if problem is None:
        how = how_to_name(run.get("problem"))
        raise InvalidInput(f"problem must be the one that was planned in {folder}, got none; {how}")
    check_fingerprint(problem, run.get("fingerprint"), wish=f"problem must be the one that was planned in {folder}")
    problem = at_samples_of(problem, stored.q)
    try:
        motions = motions_of_task(problem, stored, columns["id"])
    except InvalidRun as fault:
        raise InvalidRun(f"{folder / MOTIONS}: {fault}") from None
    if motions is None:
        raise InvalidRun(f"motions in {folder} must have the problem's times, got other times")
    columns["label"] = columns.pop("branch")
    del columns["id"]
    counts = run.get("counts")
    starts = counts.get("starts") if isinstance(counts, Mapping) else None
    return Plan(
        optima=tuple(
            Optimum(motion=motion, **dict(zip(columns, values, strict=True)))
            for motion, *values in zip(motions, *columns.values(), strict=True)
        ),
        starts=starts if isinstance(starts, int) else 0,
        levels=run["levels"],
        provenance={
            key: value for key, value in run.items() if key not in ("format", "holds", "objective", "levels", "files")
        },
    )


# The front of a run.


def load_front(folder: str | Path, problem: Any = None) -> Front:
    """Return the front of a run folder.

    Parameters
    ----------
    folder
        Folder of a run.
    problem
        Problem that the run solved, or its name, "FILE.py:NAME", whose file is run (default: none).

    Returns
    -------
    Front
        Front, whose motions have the arm of ``problem``; without it only joint positions, with a warning.

    Raises
    ------
    InvalidRun
        If the folder contains no run, or a damaged one, or its motions are not on the problem's path.
    InvalidInput
        If ``problem`` is not the one that the run solved, or cannot be loaded.

    Notes
    -----
    A run folder may come from anybody: the file that the folder itself names is never run.
    """
    folder, problem = file_path("folder", folder), named_problem(problem)
    return with_problem(Front.load(folder), folder, problem)


def with_problem(front: Front, folder: Path, problem: Any) -> Front:
    """Return a front with its problem. Raises as ``load_front`` does."""
    reference = front.provenance.get("problem")
    if problem is None:
        if reference is not None:
            text = "motions come without their arm, because the problem is not given"
            warn_user(f"{folder}: {text}: {how_to_name(reference)}")
        return front
    wish = f"problem must be the one that the run in {folder} solved"
    check_fingerprint(problem, front.provenance.get("fingerprint"), wish=wish)
    problem = at_samples_of(problem, getattr(front.motions, "q", None))
    try:
        motions = restore_motions(problem, front)
    except InvalidRun as fault:
        raise InvalidRun(f"{folder / MOTIONS}: {fault}") from None
    return attach(replace(front, motions=motions, problem=problem), folder)

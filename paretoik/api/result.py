"""A plan on disk: `run.json`, `optima.parquet` and `motions.npz`, in the format of fronts (``front.storage``).

`optima.parquet` has one row per optimum, best first: id, the objective by its name, violation_between, criticality,
discretisation_error, status, branch.
`motions.npz` has id, joint_names (dof,), time (optima, time), q (optima, time, dof).
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.infeasible_run import ObjectiveNames, infeasible_files
from paretoik.api.session import RunSession
from paretoik.errors import Infeasible, InvalidRun
from paretoik.formulations.protocol import ProblemParts, broken_words, explain_violation, task_of, violation_words
from paretoik.front.points import StoredJoints, StoredMotions
from paretoik.front.storage import array_bytes, motion_arrays, read_motions, read_verified
from paretoik.review.recording.messages import LeastViolating, PlanEnd, RecordedPoint, record_motion
from paretoik.review.recording.recorder import SearchEnd
from paretoik.runs.file_replacement import without_writers
from paretoik.runs.files import (
    MOTIONS,
    OPTIMA,
    RUN,
    check_digest,
    is_run,
    read_run,
    read_table,
    unfinished_note,
    write_result,
)
from paretoik.search.ask_tell import Search
from paretoik.search.islands import Islands
from paretoik.stop_flag import Interrupted
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.plan import Plan

# Runs that found nothing feasible: the least-violating individual or motion, and what it violates.


def infeasible_error(search: Search | Islands) -> Infeasible:
    """Return the error of an infeasible search, with its least-violating motion and what it violates."""
    nearest = search.archive.least_violating
    if nearest is None:
        return Infeasible(f"no feasible point in {search.evaluations} evaluations, and none without a failure")
    limit, reason = explain_violation(search.problem, nearest.X, nearest.G[0])
    motions = ProblemParts(search.problem).decode(nearest.X)
    return Infeasible(
        f"no motion within the limits in {search.evaluations} evaluations; of the least-violating one, {reason}",
        motion=None if motions is None else motions[0],
        limit=limit,
        violation=float(nearest.G.max()),
    )


def least_violating(search: Search | Islands) -> LeastViolating | None:
    """Return what a recording shows of the least-violating individual so far.

    Return None if there is a feasible point, or if all evaluations failed.
    """
    nearest = search.archive.least_violating
    return None if nearest is None else LeastViolating(broken=violation_words(search.problem, nearest.G[0]))


def least_violating_end(search: Search | Islands, failure: Infeasible) -> LeastViolating:
    """Return what a recording shows at the end of a search without a feasible point."""
    nearest = search.archive.least_violating
    if nearest is None:
        return LeastViolating(broken=(), reason=str(failure))
    objectives = nearest.F[0] * np.where(search.maximised, -1.0, 1.0)
    motion = record_motion(failure.motion, curves=True)
    point = RecordedPoint(id=int(nearest.ids[0]), objectives=objectives, motion=motion)
    return LeastViolating(broken=violation_words(search.problem, nearest.G[0]), reason=str(failure), point=point)


def limit_words(task: MotionTask, motion: Motion) -> tuple[str, ...]:
    """Return which limits a motion violates and by how much, the worst first."""
    return broken_words(task.limit_names, ["of its range"] * len(task.limit_names), task.violations(motion))


@contextmanager
def infeasible_recorded(
    session: RunSession, problem: Any, end: Callable[[LeastViolating], PlanEnd | SearchEnd]
) -> Iterator[None]:
    """Complete the recording with the least-violating motion if the body finds no feasible one.

    This also happens if a signal or the time limit ends the body first. ``end`` makes the end of the recording.
    """
    try:
        yield
    except (Infeasible, Interrupted) as error:
        failure = error if isinstance(error, Infeasible) else Infeasible(error.reason, motion=error.motion)
        if failure is error or failure.motion is not None:
            nearest = nearest_motion(problem, failure)
            finish_infeasible(session, problem, failure, nearest, end(nearest))
        if failure is not error and failure.motion is not None:
            error.add_note(f"by then there was {failure}")
        raise


def finish_infeasible(
    session: RunSession, names: ObjectiveNames, failure: Infeasible, nearest: LeastViolating, end: PlanEnd | SearchEnd
) -> None:
    """Complete the recording of an infeasible run, and keep its least-violating motion in the folder."""
    session.infeasible = infeasible_files(names, failure, nearest)
    with session.reviewing():
        session.finish_recording(end)


def nearest_motion(problem: Any, failure: Infeasible) -> LeastViolating:
    """Return what a recording shows of the motion of an error."""
    task, motion = task_of(problem), failure.motion
    if task is None or not isinstance(motion, Motion):
        return LeastViolating(broken=(), reason=str(failure))
    objectives = np.array([float(objective(motion)) for objective in task.objectives])
    point = RecordedPoint(id=0, objectives=objectives, motion=record_motion(motion, curves=True))
    return LeastViolating(broken=limit_words(task, motion), reason=str(failure), point=point)


# A plan on disk: writing and reading it.


HOLDS = "the optima of a plan, which load_plan opens"


def save_plan(plan: Plan, folder: Path, *, name: str, unit: str, maximised: bool) -> None:
    """Write a plan of an objective into a folder, all of its files at once or none."""
    entries = {
        **plan.provenance,
        "holds": HOLDS,
        "objective": {"name": name, "unit": unit, "maximised": maximised},
        "levels": [list(level) for level in plan.levels],
    }
    write_result(folder, entries, {OPTIMA: _optima_bytes(plan, name, unit), MOTIONS: _motions_bytes(plan)})


def holds_plan(folder: Path) -> bool:
    """Return whether a folder contains the run of a plan, complete or not."""
    return is_run(folder / RUN) and read_run(folder / RUN).get("holds") == HOLDS


def read_plan(folder: Path) -> tuple[dict[str, Any], dict[str, list[Any]], StoredMotions]:
    """Return the entries of a plan's `run.json`, the columns of its optima, and their motions.

    Raises InvalidRun if a file is missing, damaged, a link, of another version or of another run, or if the run
    contains no plan.
    """
    with without_writers(folder):
        return _read_plan(folder)


def _read_plan(folder: Path) -> tuple[dict[str, Any], dict[str, list[Any]], StoredMotions]:
    run = read_run(folder / RUN)
    if run.get("holds") != HOLDS:
        status = f" of status {run.get('status')!r}"
        note = unfinished_note(folder)
        raise InvalidRun(f"{folder} must be a run with a plan, got one{'' if 'files' in run else status} without{note}")
    check_digest(folder / RUN, run)
    files, objective, levels = run.get("files"), run.get("objective"), run.get("levels")
    if not (isinstance(files, dict) and files.keys() == {OPTIMA, MOTIONS} and _are_counts(levels)):
        raise InvalidRun(f"{folder} must contain the levels of a plan and the digests of its files, got other entries")
    if not (isinstance(objective, dict) and objective.keys() == {"name", "unit", "maximised"}):
        raise InvalidRun(f"{folder} must have an objective with name, unit and maximised, got {objective!r}")
    contents = {file: read_verified(folder / file, expected) for file, expected in files.items()}
    columns = _read_optima(folder / OPTIMA, contents[OPTIMA], str(objective["name"]))
    arrays = read_motions(folder / MOTIONS, contents[MOTIONS], np.array(columns["id"]))
    if "q" not in arrays:
        raise InvalidRun(f"{folder / MOTIONS} must contain the motions of the optima, got none")
    joints = StoredJoints(joint_names=tuple(str(joint) for joint in arrays["joint_names"]))
    return run, columns, StoredMotions(arm=joints, time=arrays["time"], q=arrays["q"])


def _are_counts(levels: object) -> bool:
    """Return whether levels are pairs of whole numbers."""
    return isinstance(levels, list) and all(
        isinstance(level, list) and len(level) == 2 and all(isinstance(count, int) for count in level)
        for level in levels
    )


def _optima_bytes(plan: Plan, name: str, unit: str) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    optima = plan.optima
    columns = {
        "id": pa.array(range(len(optima)), pa.int64()),
        name: pa.array([each.objective for each in optima], pa.float64()),
        "violation_between": pa.array([each.violation_between for each in optima], pa.float64()),
        "criticality": pa.array([each.criticality for each in optima], pa.float64()),
        "discretisation_error": pa.array([each.discretisation_error for each in optima], pa.float64()),
        "status": pa.array([each.status for each in optima], pa.string()),
        "branch": pa.array([each.label for each in optima], pa.string()),
    }
    schema = pa.schema(
        [
            pa.field(key, values.type, metadata={"unit": unit if key in (name, "discretisation_error") else ""})
            for key, values in columns.items()
        ]
    )
    sink = io.BytesIO()
    pq.write_table(pa.table(columns, schema=schema), sink)
    return sink.getvalue()


def _motions_bytes(plan: Plan) -> bytes:
    motions = [each.motion for each in plan.optima]
    stored = StoredMotions(
        arm=StoredJoints(joint_names=motions[0].arm.joint_names),
        time=np.stack([motion.time for motion in motions]),
        q=np.stack([motion.q for motion in motions]),
    )
    return array_bytes({"id": np.arange(len(motions)), **motion_arrays(stored)})


def _read_optima(file: Path, content: bytes, name: str) -> dict[str, list[Any]]:
    """Return the columns of the optima, the objective's as "objective"."""
    import pyarrow as pa

    kinds = {
        "id": pa.int64(),
        name: pa.float64(),
        "violation_between": pa.float64(),
        "criticality": pa.float64(),
        "discretisation_error": pa.float64(),
        "status": pa.string(),
        "branch": pa.string(),
    }
    try:
        table = read_table(content)
        for key in ("criticality", "discretisation_error"):
            if key not in table.column_names:  # earlier runs have none
                table = table.append_column(key, pa.array(np.full(len(table), np.nan)))
        columns = {key: table.column(key).cast(kind).to_pylist() for key, kind in kinds.items()}
    except Exception as fault:  # any error of the parser is a fault of the file
        cause = (str(fault).splitlines() or [type(fault).__name__])[0]
        raise InvalidRun(f"{file} must have the columns {', '.join(kinds)}, got {cause}") from fault
    if not columns["id"] or any(None in values for values in columns.values()):
        raise InvalidRun(f"{file} must have optima with all entries, got none or missing entries")
    return {"objective" if key == name else key: values for key, values in columns.items()}

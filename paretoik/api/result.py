"""Results in run folders: the optima of a plan, and the least-violating motion of a run that found nothing feasible.

A plan has `run.json`, `optima.parquet` and `motions.npz`, in the format of fronts (``front.storage``).
`optima.parquet` has one row per optimum, best first: id, the objective by its name, violation_between, criticality,
discretisation_error, status, branch.
`motions.npz` has id, joint_names (dof,), time (optima, time), q (optima, time, dof).

In the `run.json` of a run without a feasible point the entry "least_violating" has the constraints that are ``broken``,
the ``objectives`` by name, unit, sense and value, and the SHA-256 digest of `least_violating.npz`. That file has the
motion in the format of `motions.npz`.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.result_text import optima_entries
from paretoik.api.session import Session
from paretoik.errors import Infeasible, InvalidRun
from paretoik.formulations.protocol import ProblemParts, broken_words, explain_violation, task_of, violation_words
from paretoik.front.front import Front
from paretoik.front.points import StoredJoints, StoredMotions
from paretoik.front.storage import array_bytes, motion_arrays, read_motions, read_verified
from paretoik.review.recording.messages import LeastViolating, PlanEnd, RecordedPoint, record_motion
from paretoik.review.recording.recorder import SearchEnd
from paretoik.robot.arm import Arm
from paretoik.runs.file_replacement import without_writers
from paretoik.runs.files import (
    MOTIONS,
    NEAREST,
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


ENTRY = "least_violating"


@dataclass(frozen=True, kw_only=True, eq=False)
class InfeasibleRun:
    """A run that found nothing feasible.

    reason: why nothing was found
    broken: violated constraints
    nearest: front with only the least-violating point; empty without one
    """

    reason: str
    broken: tuple[str, ...]
    nearest: Front


def infeasible_search(search: Search | Islands) -> tuple[Infeasible, LeastViolating]:
    """Return the error of a search without a feasible point, and what a recording shows at its end."""
    nearest = search.archive.least_violating
    if nearest is None:
        failure = Infeasible(f"no feasible point in {search.evaluations} evaluations, and none without a failure")
        return failure, LeastViolating(broken=(), reason=str(failure))
    limit, reason = explain_violation(search.problem, nearest.X, nearest.G[0])
    motions = ProblemParts(search.problem).decode(nearest.X)
    failure = Infeasible(
        f"no motion within the limits in {search.evaluations} evaluations; of the least-violating one, {reason}",
        motion=None if motions is None else motions[0],
        limit=limit,
        violation=float(nearest.G.max()),
    )
    objectives = nearest.F[0] * np.where(search.maximised, -1.0, 1.0)
    motion = record_motion(failure.motion, curves=True)
    point = RecordedPoint(id=int(nearest.ids[0]), objectives=objectives, motion=motion)
    return failure, LeastViolating(
        broken=violation_words(search.problem, nearest.G[0]), reason=str(failure), point=point
    )


def limit_words(task: MotionTask, motion: Motion) -> tuple[str, ...]:
    """Return which limits a motion violates and by how much, the worst first."""
    return broken_words(task.limit_names, ["of its range"] * len(task.limit_names), task.violations(motion))


@contextmanager
def infeasible_recorded(
    session: Session, problem: Any, end: Callable[[LeastViolating], PlanEnd | SearchEnd]
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


def nearest_motion(problem: Any, failure: Infeasible) -> LeastViolating:
    """Return what a recording shows of the motion of an error."""
    task, motion = task_of(problem), failure.motion
    if task is None or not isinstance(motion, Motion):
        return LeastViolating(broken=(), reason=str(failure))
    objectives = np.array([float(objective(motion)) for objective in task.objectives])
    point = RecordedPoint(id=0, objectives=objectives, motion=record_motion(motion, curves=True))
    return LeastViolating(broken=limit_words(task, motion), reason=str(failure), point=point)


def finish_infeasible(
    session: Session, problem: Any, failure: Infeasible, nearest: LeastViolating, end: PlanEnd | SearchEnd
) -> None:
    """Complete the recording of an infeasible run, and keep its least-violating motion in the folder.

    ``problem`` has the names, units and senses of the objectives.
    """
    count = len(problem.names)
    values = [None] * count if nearest.point is None else map(float, nearest.point.objectives)
    objectives = [
        {"name": name, "unit": unit, "maximised": bool(maximised), "value": value}
        for name, unit, maximised, value in zip(problem.names, problem.units, problem.maximised, values, strict=True)
    ]
    entry: dict[str, Any] = {"broken": list(nearest.broken), "objectives": objectives}
    files = dict[str, bytes]()
    if isinstance(failure.motion, Motion) and nearest.point is not None:
        motion = failure.motion
        files[NEAREST] = motion_bytes(motion.arm, np.array(motion.time)[None], np.array(motion.q)[None])
        entry["digest"] = hashlib.sha256(files[NEAREST]).hexdigest()
    session.infeasible = ({ENTRY: entry}, files)
    with session.reviewing():
        session.finish_recording(end)


def is_infeasible(folder: Path) -> bool:
    """Return whether a folder contains a run that found nothing feasible."""
    run = read_run(folder / RUN) if is_run(folder / RUN) else {}
    return run.get("status") == "Infeasible" or (ENTRY in run and "files" not in run)  # a signal may have ended it


def read_infeasible(folder: Path) -> InfeasibleRun:
    """Return a run that found nothing feasible; raises InvalidRun if it is damaged."""
    run = read_run(folder / RUN)
    check_digest(folder / RUN, run)
    reason, entry = str(run.get("reason", "")), run.pop(ENTRY, {"broken": [], "objectives": []})
    provenance = {name: value for name, value in run.items() if name not in ("format", "reason")}
    try:
        broken, objectives = tuple(str(words) for words in entry["broken"]), list(entry["objectives"])
        values = [each["value"] for each in objectives]
        count = int(bool(values) and None not in values)
        motions = None
        if "digest" in entry and count:
            content = read_verified(folder / NEAREST, entry["digest"])
            motions = _stored_motions(folder / NEAREST, content, np.zeros(1, dtype=int), "a motion")
        nearest = Front(
            ids=np.arange(count),
            objectives=np.array(values, dtype=float)[None] if count else np.empty((0, max(len(values), 1))),
            names=[str(each["name"]) for each in objectives] or ["objective"],
            units=[str(each["unit"]) for each in objectives] or [""],
            maximised=[bool(each["maximised"]) for each in objectives] or [False],
            motions=motions,
            provenance=provenance,
        )
    except (KeyError, TypeError, ValueError, AttributeError) as fault:
        if isinstance(fault, InvalidRun):
            raise
        raise InvalidRun(f"{folder / RUN} must say what the least-violating motion violates, got {fault}") from fault
    return InfeasibleRun(reason=reason, broken=broken, nearest=nearest)


# The motions of a result.


def motion_bytes(arm: Arm, time: np.ndarray, q: np.ndarray) -> bytes:
    """Return motions (motions, time, dof) as the content of `motions.npz`, their ids from 0 on."""
    stored = StoredMotions(arm=StoredJoints(joint_names=arm.joint_names), time=time, q=q)
    return array_bytes({"id": np.arange(len(q)), **motion_arrays(stored)})


def _stored_motions(file: Path, content: bytes, ids: np.ndarray, wish: str) -> StoredMotions:
    """Return the motions of a file with these ids; raises InvalidRun, with the ``wish``, if it has none."""
    arrays = read_motions(file, content, ids)
    if "q" not in arrays:
        raise InvalidRun(f"{file} must contain {wish}, got none")
    joints = StoredJoints(joint_names=tuple(str(joint) for joint in arrays["joint_names"]))
    return StoredMotions(arm=joints, time=arrays["time"], q=arrays["q"])


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
    each = [optimum.motion for optimum in plan.optima]
    motions = motion_bytes(each[0].arm, np.stack([one.time for one in each]), np.stack([one.q for one in each]))
    write_result(folder, entries, {OPTIMA: _optima_bytes(plan, name, unit), MOTIONS: motions})


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
    are_counts = isinstance(levels, list) and all(
        isinstance(level, list) and len(level) == 2 and all(isinstance(count, int) for count in level)
        for level in levels
    )
    if not (isinstance(files, dict) and files.keys() == {OPTIMA, MOTIONS} and are_counts):
        raise InvalidRun(f"{folder} must contain the levels of a plan and the digests of its files, got other entries")
    if not (isinstance(objective, dict) and objective.keys() == {"name", "unit", "maximised"}):
        raise InvalidRun(f"{folder} must have an objective with name, unit and maximised, got {objective!r}")
    contents = {file: read_verified(folder / file, expected) for file, expected in files.items()}
    columns = _read_optima(folder / OPTIMA, contents[OPTIMA], str(objective["name"]))
    ids, wish = np.array(columns["id"]), "the motions of the optima"
    return run, columns, _stored_motions(folder / MOTIONS, contents[MOTIONS], ids, wish)


def _optima_bytes(plan: Plan, name: str, unit: str) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    entries = optima_entries(plan)
    columns = {
        key: pa.array([entry["objective" if key == name else key] for entry in entries], kind)
        for key, kind in _optima_kinds(name).items()
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


def _optima_kinds(name: str) -> dict[str, Any]:
    """Return the types of the columns of optima, in order."""
    import pyarrow as pa

    numbers = (name, "violation_between", "criticality", "discretisation_error")
    return {
        "id": pa.int64(),
        **dict.fromkeys(numbers, pa.float64()),
        **dict.fromkeys(("status", "branch"), pa.string()),
    }


def _read_optima(file: Path, content: bytes, name: str) -> dict[str, list[Any]]:
    """Return the columns of the optima, the objective's as "objective"."""
    import pyarrow as pa

    kinds = _optima_kinds(name)
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

"""Store plans and least-violating motions in run folders.

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
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.result_text import optima_entries
from paretoik.errors import Infeasible, InvalidRun
from paretoik.formulations.protocol import broken_words, task_of
from paretoik.front.points import StoredJoints, StoredMotions
from paretoik.front.storage import motion_arrays, read_motions, read_verified
from paretoik.inputs import first_line
from paretoik.review.recording.messages import LeastViolating, PlannedScene, RecordedPoint, record_motion
from paretoik.review.recording.recorder import SearchedFront
from paretoik.robot.arm import Arm
from paretoik.runs.file_replacement import without_writers
from paretoik.runs.files import (
    MOTIONS,
    NEAREST,
    OPTIMA,
    RUN,
    array_bytes,
    check_digest,
    is_run,
    read_run,
    read_table,
    table_bytes,
    unfinished_note,
    write_result,
)
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.plan import Plan

# Runs that found nothing feasible: the least-violating motion, and what it violates.


ENTRY = "least_violating"


def limit_words(task: MotionTask, motion: Motion) -> tuple[str, ...]:
    """Return a motion's violated limits and by how much, worst first."""
    return broken_words(task.limit_names, ["of its range"] * len(task.limit_names), task.violations(motion))


def nearest_motion(problem: Any, failure: Infeasible) -> LeastViolating:
    """Return the least-violating motion of an error, for a recording."""
    task, motion = task_of(problem), failure.motion
    if task is None or not isinstance(motion, Motion):
        return LeastViolating(broken=(), reason=str(failure))
    objectives = np.array([float(objective(motion)) for objective in task.objectives])
    point = RecordedPoint(id=0, objectives=objectives, motion=record_motion(motion, curves=True))
    return LeastViolating(broken=limit_words(task, motion), reason=str(failure), point=point)


def infeasible_entries(
    scene: PlannedScene | SearchedFront, nearest: LeastViolating, motion: object
) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Return entries and files, by name, of a run without feasible solutions."""
    if isinstance(scene, PlannedScene):
        objectives = [{"name": scene.name, "unit": scene.unit, "maximised": bool(scene.maximised)}]
    else:
        named = zip(scene.names, scene.units, scene.maximised, strict=True)
        objectives = [{"name": name, "unit": unit, "maximised": bool(sense)} for name, unit, sense in named]
    for i, each in enumerate(objectives):
        each["value"] = None if nearest.point is None else float(nearest.point.objectives[i])
    entry: dict[str, Any] = {"broken": list(nearest.broken), "objectives": objectives}
    files = dict[str, bytes]()
    if isinstance(motion, Motion) and nearest.point is not None:
        files[NEAREST] = motion_bytes(motion.arm, np.array(motion.time)[None], np.array(motion.q)[None])
        entry["digest"] = hashlib.sha256(files[NEAREST]).hexdigest()
    return {ENTRY: entry}, files


# The motions of a result.


def motion_bytes(arm: Arm, time: np.ndarray, q: np.ndarray) -> bytes:
    """Return motions (motions, time, dof) as the content of `motions.npz`, with ids from 0."""
    stored = StoredMotions(arm=StoredJoints(joint_names=arm.joint_names), time=time, q=q)
    return array_bytes({"id": np.arange(len(q)), **motion_arrays(stored)})


def read_stored_motions(file: Path, digest: object, ids: np.ndarray) -> StoredMotions:
    """Return the motions of a file; raises InvalidRun unless the file has this digest and these ids."""
    arrays = read_motions(file, read_verified(file, digest), ids)
    if "q" not in arrays:
        raise InvalidRun(f"{file} must contain motions, got none")
    joints = StoredJoints(joint_names=tuple(str(joint) for joint in arrays["joint_names"]))
    return StoredMotions(arm=joints, time=arrays["time"], q=arrays["q"])


# A plan on disk: writing and reading it.


HOLDS = "the optima of a plan, which load_plan opens"
NUMBERS, TEXTS = ("violation_between", "criticality", "discretisation_error"), ("status", "branch")


def save_plan(plan: Plan, folder: Path, *, name: str, unit: str, maximised: bool) -> None:
    """Write a plan into a folder: all of its files or none."""
    import pyarrow as pa

    entries = {
        **plan.provenance,
        "holds": HOLDS,
        "objective": {"name": name, "unit": unit, "maximised": maximised},
        "levels": [list(level) for level in plan.levels],
    }
    each = [optimum.motion for optimum in plan.optima]
    motions = motion_bytes(each[0].arm, np.stack([one.time for one in each]), np.stack([one.q for one in each]))
    units = {name: unit, "discretisation_error": unit}
    schema = pa.schema([field.with_metadata({"unit": units.get(field.name, "")}) for field in _optima_schema(name)])
    rows = [{**entry, name: entry["objective"]} for entry in optima_entries(plan)]
    table = pa.table({key: [row[key] for row in rows] for key in schema.names}, schema=schema)
    write_result(folder, entries, {OPTIMA: table_bytes(table), MOTIONS: motions})


def _optima_schema(name: str) -> Any:
    """Return the columns of optima with their types, in order."""
    import pyarrow as pa

    kinds = {"id": pa.int64(), **dict.fromkeys((name, *NUMBERS), pa.float64()), **dict.fromkeys(TEXTS, pa.string())}
    return pa.schema(kinds)


def holds_plan(folder: Path) -> bool:
    """Return whether a folder contains a run of ``plan``, complete or not."""
    return is_run(folder / RUN) and read_run(folder / RUN).get("holds") == HOLDS


def read_plan(folder: Path) -> tuple[dict[str, Any], dict[str, list[Any]], StoredMotions]:
    """Return a plan's `run.json` entries, its columns of optima, and its motions; raises InvalidRun if damaged."""
    with without_writers(folder):
        run = read_run(folder / RUN)
        if run.get("holds") != HOLDS:
            status = "" if "files" in run else f" of status {run.get('status')!r}"
            note = unfinished_note(folder)
            raise InvalidRun(f"{folder} must be a run with a plan, got one{status} without a plan{note}")
        check_digest(folder / RUN, run)
        try:
            run["levels"] = tuple((int(samples), int(optima)) for samples, optima in run["levels"])
            columns = _read_optima(folder / OPTIMA, run["files"][OPTIMA], str(run["objective"]["name"]))
            ids = np.array(columns["id"])
            return run, columns, read_stored_motions(folder / MOTIONS, run["files"][MOTIONS], ids)
        except InvalidRun:
            raise
        except (KeyError, TypeError, ValueError) as fault:
            raise InvalidRun(f"{folder / RUN} must have the entries of a plan, got: {fault}") from fault


def _read_optima(file: Path, digest: object, name: str) -> dict[str, list[Any]]:
    """Return the columns of the optima; the objective's column is named "objective"."""
    import pyarrow as pa

    content, kinds = read_verified(file, digest), _optima_schema(name)
    try:
        table = read_table(content)
        for key in ("criticality", "discretisation_error"):
            if key not in table.column_names:  # earlier runs lack this column
                table = table.append_column(key, pa.array(np.full(len(table), np.nan)))
        columns = {kind.name: table.column(kind.name).cast(kind.type).to_pylist() for kind in kinds}
    except Exception as fault:  # any error of the parser is a fault of the file
        wish = f"{file} must be a table with columns {', '.join(kinds.names)}"
        raise InvalidRun(f"{wish}, got: {first_line(fault)}") from fault
    if not columns["id"] or any(None in values for values in columns.values()):
        raise InvalidRun(f"{file} must have optima with all entries, got none or missing entries")
    return {"objective" if key == name else key: values for key, values in columns.items()}

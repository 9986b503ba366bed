"""A run on disk that found nothing feasible: why, and its least-violating motion.

The entry "least_violating" of `run.json` has the constraints that are ``broken``, the ``objectives`` by name, unit,
sense and value, and the SHA-256 digest of `least_violating.npz`. That file has the motion in the format of
`motions.npz`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from paretoik.errors import Infeasible, InvalidRun
from paretoik.front.front import Front
from paretoik.front.points import StoredJoints, StoredMotions
from paretoik.front.storage import array_bytes, motion_arrays, read_motions, read_verified
from paretoik.review.recording.messages import LeastViolating
from paretoik.runs.files import NEAREST, RUN, check_digest, is_run, read_run
from paretoik.task.motion import Motion

ENTRY = "least_violating"


@runtime_checkable
class ObjectiveNames(Protocol):
    """The objectives of a run, as a formulation or a search has them."""

    @property
    def names(self) -> Sequence[str]:
        """Names of the objectives."""

    @property
    def units(self) -> Sequence[str]:
        """Units of the objectives."""

    @property
    def maximised(self) -> Any:
        """Whether each objective is maximised."""


@dataclass(frozen=True, kw_only=True, eq=False)
class InfeasibleFiles:
    """Contents of a run folder without a feasible point: ``entries`` of its `run.json`, and files by name."""

    entries: Mapping[str, Any]
    contents: Mapping[str, bytes]


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


def infeasible_files(problem: ObjectiveNames, failure: Infeasible, nearest: LeastViolating) -> InfeasibleFiles:
    """Return what a run folder keeps of a run that found nothing feasible."""
    values = None if nearest.point is None else nearest.point.objectives
    objectives = [
        {
            "name": name,
            "unit": unit,
            "maximised": bool(maximised),
            "value": None if values is None else float(values[axis]),
        }
        for axis, (name, unit, maximised) in enumerate(
            zip(problem.names, problem.units, problem.maximised, strict=True)
        )
    ]
    entry: dict[str, Any] = {"broken": list(nearest.broken), "objectives": objectives}
    contents = dict[str, bytes]()
    if isinstance(failure.motion, Motion) and nearest.point is not None:
        contents[NEAREST] = _motion_bytes(failure.motion)
        entry["digest"] = hashlib.sha256(contents[NEAREST]).hexdigest()
    return InfeasibleFiles(entries={ENTRY: entry}, contents=contents)


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
        motions = _read_motion(folder, entry["digest"]) if "digest" in entry and count else None
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


def _motion_bytes(motion: Motion) -> bytes:
    joints = StoredJoints(joint_names=motion.arm.joint_names)
    stored = StoredMotions(arm=joints, time=np.array(motion.time)[None], q=np.array(motion.q)[None])
    return array_bytes({"id": np.zeros(1, dtype=int), **motion_arrays(stored)})


def _read_motion(folder: Path, expected: object) -> StoredMotions:
    file = folder / NEAREST
    arrays = read_motions(file, read_verified(file, expected), np.zeros(1, dtype=int))
    if "q" not in arrays:
        raise InvalidRun(f"{file} must contain a motion, got none")
    joints = StoredJoints(joint_names=tuple(str(joint) for joint in arrays["joint_names"]))
    return StoredMotions(arm=joints, time=arrays["time"], q=arrays["q"])

"""The run of one resolved motion: what is asked for, in words and numbers, and what is kept of it."""

from __future__ import annotations

from collections import Counter
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.run_session import Subject
from paretoik.fingerprint.fingerprint import fingerprint
from paretoik.front.joint_motions import StoredJoints, StoredMotions
from paretoik.front.storage import array_bytes, motion_arrays
from paretoik.resolution.method import Criterion, Method
from paretoik.resolution.resolve import Resolution
from paretoik.resolution.traces import ResolvedMotion
from paretoik.run_files import MOTIONS, TRACES, write_result
from paretoik.task.objectives import Objective

HOLDS = f"a resolved motion, its joint positions in {MOTIONS} and what its method did in {TRACES}"


def resolution_settings(resolution: Resolution, seed: int) -> dict[str, Any]:
    """Return the numbers of what is resolved by name."""
    return {
        "method": method_settings(resolution.method),
        "unreachable": resolution.unreachable,
        "tolerance": float(resolution.tolerance),
        "seed": seed,
    }


def resolution_subject(resolution: Resolution) -> Subject:
    """Return what is resolved as the subject of a run."""
    title = f"{type(resolution.method).__name__} of {resolution.task.arm.name}"
    return Subject(title=title, fingerprint=fingerprint(resolution))


def method_settings(method: Method) -> dict[str, Any]:
    """Return a method by its name and its numbers; of criteria their objective and gain."""
    settings: dict[str, Any] = {"name": type(method).__name__}
    for each in fields(method):
        value = getattr(method, each.name)
        if isinstance(value, tuple | list) and all(isinstance(one, Criterion) for one in value):
            settings[each.name] = [{"objective": one.objective.name, "gain": _plain(one.gain)} for one in value]
        elif isinstance(value, Objective):
            settings[each.name] = value.name
        elif value is None or isinstance(value, bool | str) or np.asarray(value).dtype.kind in "biuf":
            settings[each.name] = _plain(value)
    return settings


def motion_ending(motion: ResolvedMotion, seconds: float) -> dict[str, Any]:
    """Return how a motion came out: how many steps had which status, and how far it is off its path at most."""
    steps = Counter(motion.traces.status.ravel().tolist())
    counts = {"motions": int(np.prod(motion.q.shape[:-2])), "steps": dict(steps), "seconds": round(seconds, 3)}
    return {"status": "resolved", "counts": counts, "largest_error": float(np.abs(motion.traces.errors).max())}


def save_resolution(motion: ResolvedMotion, provenance: dict[str, Any], folder: Path) -> None:
    """Write a motion, or a batch of them, into a folder, all of their files at once or none.

    In `traces.npz` every array of ``motion.traces`` has one row a motion, as in `motions.npz`.
    """
    shape, dof = motion.q.shape[:-2], motion.arm.dof
    count = int(np.prod(shape))
    stored = StoredMotions(
        arm=StoredJoints(joint_names=motion.arm.joint_names),
        time=motion.time.reshape(count, -1),
        q=motion.q.reshape(count, -1, dof),
    )
    traces = {each.name: np.asarray(getattr(motion.traces, each.name)) for each in fields(motion.traces)}
    files = {
        MOTIONS: array_bytes({"id": np.arange(count), **motion_arrays(stored)}),
        TRACES: array_bytes({name: each.reshape(count, *each.shape[len(shape) :]) for name, each in traces.items()}),
    }
    write_result(folder, {**provenance, "holds": HOLDS, "batch": list(shape)}, files)


def _plain(value: Any) -> Any:
    """Return a number or an array of numbers as JSON has it; others as they are."""
    return value if value is None or isinstance(value, bool | str) else np.asarray(value).tolist()

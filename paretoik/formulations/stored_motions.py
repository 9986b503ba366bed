"""The motions of a stored run with their arm: a file may come from anybody, so they are held against their task."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from paretoik.errors import InvalidRun
from paretoik.formulations.protocol import is_loop
from paretoik.front.front import Front
from paretoik.front.joint_motions import JointMotions
from paretoik.inputs import shown
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import relative_errors, row_scales
from paretoik.task.task import describe_errors


@dataclass(frozen=True, kw_only=True)
class StoredMotionOptions:
    """So far a stored motion may be off its path, or a loop off what its run says: what we claim of every motion."""

    tolerance: float = 1e-9  # of the arm's length, and rad; of a loop m


OPTIONS = StoredMotionOptions()


def restore_motions(problem: Any, front: Front) -> Any:
    """Return the motions of a stored front with their arm: from its joint positions, or else from its genes.

    Raises InvalidRun as ``motions_of_task`` does.
    """
    if front.motions is None:
        return None
    motions = motions_of_task(problem, front.motions, front.ids.tolist()) if hasattr(problem, "task") else None
    if motions is not None:
        if is_loop(front):
            _check_loop(motions, front.provenance.get("position_error"))
        return motions
    if _is_on_path(problem):
        raise InvalidRun("motions: the times of the problem's path wanted, got others")
    decodes = hasattr(problem, "decode") and front.genes is not None
    return problem.decode(np.array(front.genes)) if decodes else front.motions


def motions_of_task(problem: Any, stored: JointMotions, ids: Sequence[int]) -> Motion | None:
    """Return stored motions with the arm of a problem's task, joints matched by name; None where they have other times.

    Raises InvalidRun where the joints are others, or a motion is off the path although tracking constrains it.
    """
    task: MotionTask = problem.task
    q, names = np.asarray(stored.q), list(stored.arm.joint_names)
    if sorted(names) != sorted(task.arm.joint_names):
        raise InvalidRun(f"motions: joints {', '.join(task.arm.joint_names)} wanted, got {', '.join(names)}")
    task = task.truncate(q.shape[-2])
    if not np.allclose(stored.time, task.times, rtol=1e-9, atol=0):
        return None
    motions = task.motion(q[..., [names.index(name) for name in task.arm.joint_names]])
    if _is_on_path(problem):
        _check_tracking(task, motions, ids)
    return motions


def _check_loop(motions: Motion, stated: object) -> None:
    """Raise InvalidRun unless a loop is as far off its path on average (Marcos et al. 2012, Eq. 23) as its run says."""
    error = float(motions.position_error[..., 1:].mean())
    if not (isinstance(stated, float | int) and abs(error - stated) <= OPTIONS.tolerance * max(error, 1.0)):
        raise InvalidRun(f"motions: a mean distance of {shown(stated)} m from the path wanted, got {error:.6g} m")


def _is_on_path(problem: Any) -> bool:
    """Say whether motions of a problem follow its path exactly; loops and resolvers have errors of their own."""
    return getattr(problem, "follows_path", False) is True


def _check_tracking(task: MotionTask, motions: Motion, ids: Sequence[int]) -> None:
    relative, _ = relative_errors(task.arm, task.tasks, motions.q, task.targets)
    off = np.argwhere(~(np.abs(relative).max(axis=-1, initial=0.0) <= OPTIONS.tolerance))
    if len(off):
        row, sample = (int(i) for i in off[0])
        distance = describe_errors(task.tasks, relative[row, sample] * row_scales(task.arm, task.tasks))
        raise InvalidRun(
            f"motions: on the path of the problem wanted, got point {ids[row]} {distance} off it at sample {sample} "
            f"({task.times[sample]:.3g} s)"
        )

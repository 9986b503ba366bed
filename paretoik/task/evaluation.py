"""The evaluation of motions: objectives and limits, and the causes of those that fail."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from paretoik.arrays import Objectives
from paretoik.errors import EvaluationFailed
from paretoik.stop_flag import check_interruption
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.user_functions import warn_of_odd_objectives


def examine_functions(task: MotionTask, motions: Motion) -> None:
    """Warn of objectives that are constant or a matter of chance; raises as ``require_values``."""
    F, again = require_values(task, motions), evaluate_motions(task, motions[:1])[0]
    signs = np.array([each.sign for each in task.objectives])
    warn_of_odd_objectives([each.name for each in task.objectives], F * signs, again * signs)


def require_values(task: MotionTask, motions: Motion) -> Objectives:
    """Return F of motions as ``evaluate_motions``; raise EvaluationFailed, with the first cause, where all failed."""
    F, _, causes = evaluate_motions(task, motions)
    if all(causes):
        raise EvaluationFailed(f"every evaluation failed, the first with: {causes[0]}")
    return F


def evaluate_motions(
    task: MotionTask, motions: Motion, *, interruptible: bool = True
) -> tuple[Objectives, np.ndarray, np.ndarray]:
    """Return F, minimised, the violations of limits (points, limits), and causes of failure (points,).

    What fails is NaN, and its cause says why. Raises Interrupted after a signal, unless it is not ``interruptible``.
    """
    if interruptible:
        check_interruption()
    causes = np.full(len(motions), "", dtype=object)
    columns = [_isolate([f"objective {o.name}"], o, motions, causes, interruptible) * o.sign for o in task.objectives]
    limits = _isolate(task.limit_names, task.violations, motions, causes, interruptible)
    return np.array(columns).reshape(len(columns), len(motions)).T, limits, causes


def _isolate(
    names: Sequence[str],
    function: Callable[[Motion], np.ndarray],
    motions: Motion,
    causes: np.ndarray,
    interruptible: bool,
) -> np.ndarray:
    """Return users' functions of motions, (points, names), one by one where the batch raises; NaN for what fails."""
    if interruptible:
        check_interruption()
    try:
        values = function(motions)
    except EvaluationFailed as error:
        if len(motions) == 1:
            causes[0] = causes[0] or str(error)
            return np.full((1, len(names)), np.nan)
        parts = [
            _isolate(names, function, motions[i : i + 1], causes[i : i + 1], interruptible) for i in range(len(motions))
        ]
        return np.concatenate(parts)
    values = values.reshape(len(values), -1)
    for i, row in enumerate(values):
        failed = np.flatnonzero(~np.isfinite(row))
        if len(failed):
            causes[i] = causes[i] or f"{names[failed[0]]} is {row[failed[0]]}"
    return values

"""A motion problem in a few lines of text."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from paretoik.tables import columns

if TYPE_CHECKING:  # they write themselves with this
    from paretoik.task.motion_task import MotionTask


def task_text(task: MotionTask) -> str:
    """Return what moves, along what, for which objectives, within which limits."""
    start = "free" if task.start is None else "given"
    if task.cyclic:
        start += ", closed"
    rows = [
        ("arm", f"{task.arm.name}, {task.arm.dof} joints, {task.redundancy} of them redundant"),
        ("path", f"{len(task.times)} samples, {task.times[-1]:.4g} s, start {start}"),
        ("objectives", ", ".join(objective_text(each.name, each.unit, each.maximise) for each in task.objectives)),
        ("limits", ", ".join(_limits(task)) or "none"),
    ]
    if task.obstacles:
        rows.append(("obstacles", f"{len(task.obstacles)}, links of radius {task.link_radius:g} m"))
    return columns(rows)


def _limits(task: MotionTask) -> Iterator[str]:
    """Yield what is limited: a quantity of all joints as one, of some by their names."""
    names = list(task.limit_names)
    for kind in task.bounds:
        joints = [joint for joint in task.arm.joint_names if f"{kind} of {joint}" in names]
        names = [name for name in names if name not in {f"{kind} of {joint}" for joint in joints}]
        if joints:
            yield f"{kind} of " + ("all joints" if len(joints) == task.arm.dof else ", ".join(joints))
    yield from names


def objective_text(name: str, unit: str, maximised: bool) -> str:
    """Return an objective's name with its unit, and whether it is maximised."""
    return name + (f" [{unit}]" if unit else "") + (" (maximised)" if maximised else "")

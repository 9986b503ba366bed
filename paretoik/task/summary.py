"""Motions and motion problems in a few lines of text: names, units, sizes, and what to do next."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from paretoik.tables import columns

if TYPE_CHECKING:  # they write themselves with this
    from paretoik.task.motion import Motion
    from paretoik.task.motion_task import MotionTask


def motion_text(motion: Motion) -> str:
    """Return how many motions of how many samples there are, and the range of every joint."""
    batch, samples = motion.q.shape[:-2], motion.q.shape[-2]
    count = "one motion" if not batch else f"motions {' × '.join(map(str, batch))}"
    shortest, longest = np.min(motion.duration, initial=np.inf), np.max(motion.duration, initial=0.0)
    lasts = f"{longest:.4g} s" if shortest >= longest else f"{shortest:.4g} to {longest:.4g} s"
    lines = [f"Motion of {motion.arm.name}: {count}, {samples} samples, {lasts}"]
    if motion.q.size:
        rows = [["joint", "unit", "least position", "greatest", "fastest per s"]]
        low, high, speed = (each.reshape(-1, motion.arm.dof) for each in (motion.q, motion.q, np.abs(motion.dq)))
        for i, (name, kind) in enumerate(zip(motion.arm.joint_names, motion.arm.joint_types, strict=True)):
            numbers = (low[:, i].min(), high[:, i].max(), speed[:, i].max())
            rows.append([name, "m" if kind == "prismatic" else "rad", *(f"{number:.4g}" for number in numbers)])
        lines.append(columns(rows))
    return "\n".join([*lines, "has .time .q .dq .ddq .torque .power .tool, .at(t) between samples"])


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

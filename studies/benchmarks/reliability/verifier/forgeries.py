"""Runs presented as those of a stricter problem, whose limits or obstacles their motions violate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

import paretoik as pk
from paretoik.runs.fingerprint import fingerprint
from paretoik.task.motion_task import finer_motion
from studies.benchmarks.reliability.verifier.editing import Edited, edit
from studies.benchmarks.reliability.verifier.good_runs import ARM, LIMITS, tracking

LIMITED = {"position": "q", "velocity": "dq", "acceleration": "ddq", "torque": "torque", "power": "power"}
"""The limits of a problem, and the arrays of a motion that they bound."""


def forge(source: Path, folder: Path, problem: pk.Tracking) -> Path:
    """Copy a run as one of another problem that no motion violates, not between samples either."""

    def change(run: Edited) -> None:
        run.entries["fingerprint"] = fingerprint(problem)
        run.table["violation_between"] = [0.0 for _ in run.table["violation_between"]]

    return edit(source, folder, change)


def _motions(front: pk.Front) -> pk.Motion:
    assert isinstance(front.motions, pk.Motion)
    return front.motions


def thin_obstacle(front: pk.Front) -> pk.Tracking:
    """Return the problem with a disc that a motion's tool meets only between two instants."""
    motion = _motions(front)[0]
    for q in motion.at(motion.time[:-1] + 0.25 * np.diff(motion.time)):
        disc = pk.obstacles.Circle(ARM.pose(q).position[:2], 0.004)
        if replace(motion.instants, obstacles=(disc,)).clearance.min() > 1e-3:
            return tracking(obstacles=[disc])
    raise AssertionError("no place that the tool passes between instants")


def exceeded_between(front: pk.Front) -> pk.Tracking:
    """Return the problem with a limit that motions satisfy at all instants, and exceed between them."""
    for kind, name in (("power", "power"), ("torque", "torque"), ("position", "q")):
        limit = largest(front, name)
        if np.abs(getattr(finer_motion(_motions(front)), name)).max() > (1 + 2e-4) * limit:
            return with_limits(**{kind: limit})
    raise AssertionError("no limit that is largest between instants")


def with_limits(**limits: float) -> pk.Tracking:
    """Return the problem with these limits in place of others."""
    return tracking(limits={**LIMITS, **limits})


def exceeded(front: pk.Front, kind: str) -> pk.Tracking:
    """Return the problem with a limit that a motion exceeds by a hundredth at an instant."""
    return with_limits(**{kind: 0.99 * largest(front, LIMITED[kind])})


def largest(front: pk.Front, name: str) -> float:
    """Return the largest absolute value of an array of the motions at the instants of limits."""
    return float(np.abs(getattr(_motions(front).instants, name)).max(axis=(1, 2)).max())


FORGERIES: dict[str, tuple[str, Callable[[pk.Front], pk.Tracking], str]] = {
    **{f"{kind} limit exceeded": ("search", partial(exceeded, kind=kind), f"{kind} limits") for kind in LIMITED},
    "a collision between samples": ("search", thin_obstacle, "clearance between samples"),
    "a limit exceeded between samples": ("certified", exceeded_between, "limits between samples"),
}
"""By name: the kind of run, the problem that its front is presented for, the subject of the check that must fail."""

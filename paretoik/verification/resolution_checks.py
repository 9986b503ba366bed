"""Resolved motions: what the files say of themselves, and, with its problem, of the path."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from paretoik.verification.arm_model import ArmModel
from paretoik.verification.options import TOLERANCES
from paretoik.verification.path_targets import sample_points, tracking_errors
from paretoik.verification.report import Check, demand, judge, leave_out
from paretoik.verification.run_contents import RunContents


def check_resolution(run: RunContents, task: Any, model: ArmModel | None, reason: str = "") -> Iterator[Check]:
    """Check the errors that a resolved motion states; ``task`` has the path that it followed, None if not at hand."""
    traces = run.arrays.get("traces.npz", {})
    errors = np.asarray(traces.get("errors", np.empty(0)))
    stated = float(run.entries.get("largest_error", np.nan))
    largest = float(np.abs(errors).max(initial=0.0))
    yield judge(
        "largest error",
        abs(stated - largest),
        TOLERANCES.traces,
        f"run.json says {stated:.8g}, traces say {largest:.8g}",
    )
    counts = run.entries.get("counts", {}).get("steps", {})
    statuses = np.asarray(traces.get("status", np.empty(0))).ravel().tolist()
    yield demand("steps", sum(counts.values()) == len(statuses), "run.json counts other steps than the traces have")
    if task is None or model is None:
        missing = "arm and path are not in the files; verify(folder, problem) names them"
        yield leave_out("tracking", reason or missing)
        return
    for row, (time, q) in enumerate(zip(run.motions["time"], run.motions["q"], strict=True)):
        point = int(run.ids[row])
        same = len(time) == len(task.times) and np.allclose(
            time, task.times, rtol=0, atol=TOLERANCES.times * task.times[-1]
        )
        yield demand("times of the path", same, "its times are not those of the path", point=point)
        if not same:
            continue
        parts = [tracking_errors(model, each, q, *sample_points(each.path)) for each in task.tasks]
        miss = max(float(max(distance.max(), angle.max())) for distance, angle in parts)
        admitted = float(np.linalg.norm(errors[row], axis=-1).max()) if errors.ndim > 2 else largest
        detail = f"the tool is {miss:.3g} off its path, its traces admit {admitted:.3g}"
        yield judge("tracking", miss, admitted + TOLERANCES.on_path, detail, point=point)
    yield leave_out("limits and the method's steps", "a method may exceed limits where it says so in its traces")

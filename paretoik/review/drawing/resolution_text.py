"""What is said of a resolved motion beside its pictures, in Markdown."""

from __future__ import annotations

from collections import Counter

import numpy as np

from paretoik.review.drawing.point_text import run_text
from paretoik.review.drawing.screen_text import screen_text
from paretoik.review.recording.resolved import RecordedTraces, ResolutionEnd, ResolvedScene

STATUSES = {
    "damped": "damped, near a singularity",
    "shortened": "shortened: a joint were to go more than 1 rad or m",
    "held": "held: no velocities do what the task wants",
    "limited": "limited: the task gives way to limits",
    "missed": "missed: the step does not end on the path",
}


def motion_text(scene: ResolvedScene, traces: RecordedTraces, end: ResolutionEnd) -> str:
    """Return what is to be known of a motion: its errors, its steps, and its method."""
    worst = int(traces.error.argmax())
    several = end.count > 1
    lines = [
        f"# {scene.method}" + (f", {traces.name} of {end.count}" if several else ""),
        f"- largest error {traces.error[worst]:.3g} {scene.error_unit} at {traces.time[worst]:.3g} s; "
        f"the path counts as lost from {scene.tolerance:.3g} on",
        f"- greatest joint speed {traces.speed.max():.4g} at {traces.time[int(traces.speed.argmax()) + 1]:.3g} s",
    ]
    if traces.clearance is not None:
        nearest = int(traces.clearance.argmin())
        lines.append(f"- least clearance {traces.clearance[nearest]:.3g} m at {traces.time[nearest]:.3g} s")
    if reason := end.provenance.get("reason"):
        lines += ["", "## Why it ended", "", str(reason)]
    lines += ["", "## Steps", ""]
    steps = Counter(traces.status.tolist())
    lines += [f"- {count} {STATUSES.get(status, status)}" for status, count in steps.most_common()]
    method = (end.provenance.get("settings") or {}).get("method") or {}
    if numbers := [
        f"- {name.replace('_', ' ')}: {_value(value)}"
        for name, value in method.items()
        if name != "name" and value not in (None, [])
    ]:
        lines += ["", "## Method", "", *numbers]
    return screen_text("\n".join([*lines, "", run_text(end.provenance)]))


def step_text(traces: RecordedTraces, step: int) -> str:
    """Return what begins at a step."""
    status = str(traces.status[step])
    return screen_text(f"**From {traces.time[step]:.4g} s on: {STATUSES.get(status, status)}**")


def _value(value: object) -> str:
    """Return a setting in words; of a criterion its objective and gain."""
    if isinstance(value, dict):
        return ", ".join(f"{name} {_value(each)}" for name, each in value.items())
    if isinstance(value, list):
        return ", ".join(_value(each) for each in value[:6]) + (", …" if len(value) > 6 else "")
    return f"{value:.5g}" if isinstance(value, float) and np.isfinite(value) else str(value)

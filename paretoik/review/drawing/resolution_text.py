"""What is said of a resolved motion beside its pictures, in Markdown."""

from __future__ import annotations

from collections import Counter

import numpy as np

from paretoik.review.drawing.broken_limits import broken_limits
from paretoik.review.drawing.screen_text import screen_text
from paretoik.review.joint_units import is_sliding, joint_units
from paretoik.review.recording.resolved import RecordedTraces, ResolutionEnd, ResolvedScene
from paretoik.review.run_words import run_text
from paretoik.robot.arm import Arm
from paretoik.task.limits import JOINT_UNITS

STATUSES = {
    "done": "done, neither damped nor cut short",
    "damped": "damped, near a singularity",
    "shortened": "shortened: whole, it would move a joint by more than 1 rad or 1 m",
    "held": "held: no velocities do what the task wants",
    "limited": "limited: the task gives way to limits",
    "missed": "missed: the step does not end on the path",
}


def motion_text(scene: ResolvedScene, traces: RecordedTraces, end: ResolutionEnd) -> str:
    """Return what is to be known of a motion: its errors, the limits it breaks, its steps, and its method."""
    worst = int(traces.error.argmax())
    lines = [
        f"# {scene.method}" + (f", {traces.name} ({traces.point.id + 1} of {end.count})" if end.count > 1 else ""),
        f"- largest error {traces.error[worst]:.3g} {scene.error_unit} at {traces.time[worst]:.3g} s; "
        f"the path counts as lost from {scene.tolerance:.3g} {scene.error_unit} on",
        f"- greatest joint speed, all joints together: {traces.speed.max():.4g} {speed_unit(scene.workcell.arm)} at "
        f"{traces.time[int(traces.speed.argmax()) + 1]:.3g} s",
    ]
    if traces.clearance is not None:
        nearest = int(traces.clearance.argmin())
        lines.append(f"- least clearance {traces.clearance[nearest]:.3g} m at {traces.time[nearest]:.3g} s")
    if reason := end.provenance.get("reason"):
        lines += ["", "## Why it ended", "", str(reason)]
    lines += _limits(scene, traces)
    lines += ["", "## Steps", ""]
    steps = Counter(traces.status.tolist())
    lines += [f"- {count} {STATUSES.get(status, status)}" for status, count in steps.most_common()]
    lines += _method(scene, traces, end)
    return screen_text("\n".join([*lines, "", run_text(end.provenance)]))


def _limits(scene: ResolvedScene, traces: RecordedTraces) -> list[str]:
    """Return which limits of joints a motion breaks, or that it keeps them; nothing where there are none."""
    assert traces.point.motion is not None
    if not scene.workcell.bounds:
        return []
    broken = broken_limits(scene.workcell, traces.point.motion)
    return ["", "## Limits broken", "", *broken] if broken else ["", "Limits of joints are kept at all samples."]


def speed_unit(arm: Arm) -> str:
    """Return the unit of joint speeds, of two where an arm turns and slides."""
    return joint_units(arm, JOINT_UNITS["velocity"])


def damping_unit(scene: ResolvedScene) -> str:
    """Return the unit of the damping, which is that of the Jacobian."""
    turns = not is_sliding(scene.workcell.arm).any()
    return "m/rad" if turns and scene.error_unit == "m" else "units of the Jacobian"


def _method(scene: ResolvedScene, traces: RecordedTraces, end: ResolutionEnd) -> list[str]:
    """Return the numbers of the method with their units; of one that each motion has another of, that of this one."""
    units = {
        "damping": damping_unit(scene),
        "region": damping_unit(scene),
        "repulsion": speed_unit(scene.workcell.arm),
        "buffer": "of a joint's range",
        "band": "of a criterion's range",
    }
    method = (end.provenance.get("settings") or {}).get("method") or {}
    numbers = list[str]()
    for name, value in method.items():
        if name == "name" or value in (None, []):
            continue
        by_motion = np.ravel(value) if isinstance(value, list) and _is_numeric(value) else np.zeros(0)
        if end.count > 1 and len(by_motion) == end.count:
            value = float(by_motion[traces.point.id])
        numbers.append(f"- {name.replace('_', ' ')}: {_value(value)} {units.get(name, '')}".rstrip())
    return ["", "## Method", "", *numbers] if numbers else []


def _is_numeric(value: list[object]) -> bool:
    return all(_is_numeric(each) if isinstance(each, list) else isinstance(each, int | float) for each in value)


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

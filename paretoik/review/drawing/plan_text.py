"""What is said of a plan beside its pictures, in Markdown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from paretoik.review.drawing.infeasible_text import broken_lines
from paretoik.review.drawing.plan_panel import PlanPanel
from paretoik.review.drawing.screen_text import screen_text
from paretoik.review.drawing_options import DRAWING
from paretoik.review.recording.planned import PlanEnd, PlannedLevel, PlannedOptimum, PlannedScene
from paretoik.review.run_words import counted, run_text
from paretoik.task.limits import JOINT_UNITS


def level_text(panel: PlanPanel, level: PlannedLevel) -> str:
    """Return what is to be known of a level."""
    scene, motions = panel.scene, level.motions
    lines = [f"# Level {level.number}: {level.samples} samples", _level_counts(level)]
    if beyond := panel.beyond(level):
        lines.append(f"{counted(beyond, 'start')} too far off for the picture: dashes at its edge.")
    if len(panel.levels) > 1:
        lines.append("Values of different levels are not comparable: a motion of other samples has another value.")
    if level.least_violating is not None:
        lines += ["", "What the least-violating one breaks:", "", *broken_lines(level.least_violating)]
        return screen_text("\n".join(lines))
    lines += ["", "## Optima of the level", ""]
    for place, value in enumerate(level.optima[: DRAWING.optima]):
        hits = int((motions.optimum == place).sum())
        lines.append(f"- {place}: {_value(scene, value)}, from {counted(hits, 'start')}")
    lines += _further(len(level.optima))
    return screen_text("\n".join(lines))


def _level_counts(level: PlannedLevel) -> str:
    """Return what the starts of a level led to, by numbers."""
    starts, failed = counted(len(level.starts), "start"), int((~np.isfinite(level.ends)).sum())
    if level.least_violating is not None:
        return f"{starts}; none led to a motion that keeps all limits. The arm shows the least-violating one."
    words = f"{starts}, {counted(len(level.optima), 'distinct optimum', 'distinct optima')}"
    return f"{words}; {failed} of the starts led to none." if failed else f"{words}."


def start_text(scene: PlannedScene, level: PlannedLevel, row: int) -> str:
    """Return what is to be known of the start of a level at a row."""
    optimum = int(level.motions.optimum[row])
    lines = [
        f"# Start {row + 1} of the {len(level.starts)} of level {level.number}, {level.samples} samples",
        f"- begins with {_value(scene, level.starts[row])}",
    ]
    if np.isfinite(level.ends[row]):
        lines.append(f"- leads to {_value(scene, level.ends[row])}")
    if optimum >= 0:
        lines.append(f"- that is optimum {optimum} of the level's {len(level.optima)}")
    elif np.isfinite(level.ends[row]):
        lines.append("- an optimum that was not kept: there are too many, or perturbed ones lie near")
    else:
        lines.append("- leads to no optimum: the arm shows where its solver stopped")
    return screen_text("\n".join(lines))


def optimum_text(scene: PlannedScene, optima: Sequence[PlannedOptimum], place: int, count: int) -> str:
    """Return what is to be known of a final optimum, of ``count`` in all."""
    optimum, best = optima[place], optima[0]
    value, least = float(optimum.point.objectives[0]), float(best.point.objectives[0])
    lines = [
        f"# Optimum {place} ({place + 1} of {count})" + (", the best" if place == 0 else ""),
        f"- **{scene.name}**{', more is better' if scene.maximised else ''}: {_value(scene, value)}"
        + (f", {100 * abs(value - least) / max(abs(least), 1e-300):.3g}% worse than the best" if place else ""),
        f"- branch {_branch(optimum)}: how each inner joint is bent, `~` before one that passes through straight"
        if optimum.branch
        else "",
        f"- {optimum.status} (local)",
        f"- violation {optimum.violation_between:.2g} of a limit's range on a finer grid"
        if np.isfinite(optimum.violation_between)
        else "- leaves its path between the samples",
        f"- as good and of the same branch: {twin}" if (twin := _twin_words(scene, optima, place)) else "",
    ]
    return screen_text("\n".join(line for line in lines if line))


def plan_end_text(scene: PlannedScene, end: PlanEnd, first: int, starts: int) -> str:
    """Return what is to be known of a plan whose ``first`` level had so many starts, and all together ``starts``."""
    lines = [optimum_text(scene, end.optima, 0, len(end.optima)), "", "## Optima", ""]
    lines += [
        ", ".join(
            filter(
                None,
                (
                    f"- {place}: {_value(scene, each.point.objectives[0])}",
                    _branch(each) if each.branch else "",
                    _twin_words(scene, end.optima, place),
                ),
            )
        )
        for place, each in enumerate(end.optima[: DRAWING.optima])
    ]
    lines += [*_further(len(end.optima)), "", _start_counts(first, starts)]
    return screen_text("\n".join([*lines, "", run_text(end.provenance)]))


def _twin_words(scene: PlannedScene, optima: Sequence[PlannedOptimum], place: int) -> str:
    """Return in what an optimum differs from the first before it whose value and branch read the same; "" of none.

    That is the largest difference of a joint at a sample, with its sign.
    """
    words = [(_value(scene, each.point.objectives[0]), each.branch) for each in optima[: place + 1]]
    twin = words.index(words[place])
    motion, reference = optima[place].point.motion, optima[twin].point.motion
    if twin == place or motion is None or reference is None:
        return ""
    difference = motion.q - reference.q
    row, joint = np.unravel_index(int(np.abs(difference).argmax()), difference.shape)
    arm = scene.workcell.arm
    unit = JOINT_UNITS["position"][arm.joint_types[joint] == "prismatic"]
    return (
        f"{arm.joint_names[joint]} {difference[row, joint]:+.3g} {unit} from optimum {twin} at {motion.time[row]:.3g} s"
    )


def _start_counts(first: int, starts: int) -> str:
    words = f"The first level had {counted(first, 'start')}"
    return f"{words}; those after it begin from its optima, {starts - first} in all." if starts > first else f"{words}."


def _branch(optimum: PlannedOptimum) -> str:
    return f"`{optimum.branch}`"  # as it is: Markdown strikes out what stands between tildes


def _further(count: int) -> list[str]:
    return [f"- and {count - DRAWING.optima} more"] if count > DRAWING.optima else []


def _value(scene: PlannedScene, value: float) -> str:
    return f"{value:.5g} {scene.unit}".rstrip()

"""What is said of a point of a front beside its picture, in Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from paretoik.front.compromise import COMPROMISE_IN_WORDS
from paretoik.front.front import Choice, Front
from paretoik.review.drawing.screen_text import screen_text
from paretoik.review.drawing.search_charts import front_size
from paretoik.review.drawing.search_scene import SearchScene
from paretoik.review.recording.recorder import Generation

SETTINGS = ("population", "generations", "seed", "points", "starts", "refine", "solver", "weights", "warm_start")

COUNTS = ("generations", "evaluations", "steps", "levels", "starts", "optima", "converged", "improved", "seconds")
FACTS = {"problem": "problem", "status": "ended by"}


def choice_text(front: Front, choice: Choice, *, title: str = "chosen") -> str:
    """Return what is to be known of a choice: its reason, objectives, certificate, exchange rates, and the run."""
    return _point_text(front, choice.index, title, choice.reason)


def point_text(front: Front, row: int, *, chosen: Choice | None) -> str:
    """Return what is to be known of any point of a front."""
    if chosen is not None and chosen.index == row:
        return choice_text(front, chosen)
    return _point_text(front, row, f"one of {len(front)}", "")


def _point_text(front: Front, row: int, title: str, reason: str) -> str:
    why = f"## Why\n\n{reason}" if reason else ""
    parts = [f"# Point {front.ids[row]}, {title}", _objectives(front, row), why]
    if front.certificates is not None:
        parts += [_certificate(front, row), _rates(front, row)]
    elif front.violation is not None:
        parts.append(
            f"## Certificate\n\nNone: the point was not refined. Largest violation at samples: "
            f"{front.violation[row]:.2g} of a limit's range."
        )
    parts.append(run_text(front.provenance))
    return screen_text("\n\n".join(part for part in parts if part))


def text_of(scene: SearchScene, generation: Generation, moved: int | None = None) -> str:
    """Return what is to be known of a generation and its compromise, or of a step of a closed loop.

    ``moved`` is the generation whose motions are shown with it.
    """
    if scene.timeline == "step":
        return screen_text(_step_text(scene, generation))
    return screen_text(_generation_text(scene, generation, moved))


def _generation_text(scene: SearchScene, generation: Generation, moved: int | None) -> str:
    size = front_size(generation)
    summary = f"{size} {'point' if size == 1 else 'points'} on the front"
    if generation.hypervolume is not None:
        summary += f", hypervolume {generation.hypervolume:.4g}"
    summary += f"; {generation.failed} evaluations failed so far." if generation.failed else "."
    lines = [f"# {_heading(scene, generation)}", summary]
    chosen = next((point for point in generation.points if point.axis is None), None)
    if len(generation.front):
        best = scene.best(generation.front)
        lines += [
            f"- **{scene.names[axis]}**: best {_value(best[axis], scene.units[axis])}"
            + ("" if chosen is None else f", compromise {chosen.objectives[axis]:.4g}")
            for axis in range(len(scene.names))
        ]
    if chosen is not None:
        lines += ["", f"The compromise, point {chosen.id}, is {COMPROMISE_IN_WORDS}."]  # a paragraph below the list
    if moved is not None and moved != generation.number:
        lines += ["", f"The arm shows generation {moved}: these motions were not kept."]
    return "\n".join(lines)


def _heading(scene: SearchScene, generation: Generation) -> str:
    if scene.timeline == "refinement":
        return "Before" if generation.origins is None else "After"
    return f"{scene.timeline.capitalize()} {generation.number}"


def _step_text(scene: SearchScene, generation: Generation) -> str:
    lines = [f"# Step {generation.number}", f"{len(generation.front)} points on its front."]
    if generation.chosen is not None and len(generation.front):
        low, high = generation.front.min(axis=0), generation.front.max(axis=0)
        lines += [
            f"- **{name}**: chosen {generation.chosen[axis]:.6g} {scene.units[axis]}, the front from "
            f"{low[axis]:.6g} to {high[axis]:.6g}"
            for axis, name in enumerate(scene.names)
        ]
    return "\n".join(lines)


def _objectives(front: Front, row: int) -> str:
    lines = ["## Objectives", ""]
    for axis, name in enumerate(front.names):
        low, high = front.ranges[axis]
        sense = ", more is better" if front.maximised[axis] else ""
        lines.append(
            f"- **{name}{sense}**: {_value(front.objectives[row, axis], front.units[axis])}; on the front "
            f"{low:.4g} to {high:.4g}, {front.shares[row, axis]:.0%} of that from the best"
        )
    return "\n".join(lines)


def _certificate(front: Front, row: int) -> str:
    certificates = front.certificates
    assert certificates is not None
    lines = [
        f"- {certificates.status[row]} (local)" + (f": {certificates.reason[row]}" if certificates.reason[row] else ""),
        f"- criticality χ {certificates.kkt_residual[row]:.2g} of the ranges",
        f"- violation {certificates.violation[row]:.2g} at samples, {certificates.violation_between[row]:.2g} between, "
        "of a limit's range",
    ]
    return "## Certificate\n\n" + "\n".join(lines)


def _rates(front: Front, row: int) -> str:
    certificates = front.certificates
    assert certificates is not None
    rates = certificates.exchange_rates[row]
    lines = [
        f"- 1 {front.units[i] or front.names[i]} more of {front.names[i]}: {rates[i, j]:+.4g} {front.units[j]} of "
        f"{front.names[j]}"
        for i in range(len(front.names))
        for j in range(len(front.names))
        if i != j and np.isfinite(rates[i, j])
    ]
    return "## Exchange rates\n\n" + "\n".join(lines) if lines else ""


def run_text(provenance: Mapping[str, Any]) -> str:
    """Return what is to be known of a run: its problem, settings, and how long it took; "" for nothing."""
    settings = dict(provenance.get("settings") or {})
    shown = [f"- {name.replace('_', ' ')}: {settings[name]}" for name in SETTINGS if settings.get(name) is not None]
    counts = provenance.get("counts") or {}
    took = [f"{counts[name]} {name}" for name in COUNTS if name in counts]
    heads = [f"- {word}: {provenance[name]}" for name, word in FACTS.items() if provenance.get(name)]
    lines = heads + shown + ([f"- took {', '.join(took)}"] if took else [])
    return "## Run\n\n" + "\n".join(lines) if lines else ""


def _value(value: float, unit: str) -> str:
    return f"{value:.4g} {unit}".rstrip()

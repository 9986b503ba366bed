"""The text of a point of a front, in Markdown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from paretoik.arrays import Objectives
from paretoik.front.choice import Choice
from paretoik.front.front import Front
from paretoik.front.preferences.knee_and_compromise import COMPROMISE_IN_WORDS
from paretoik.review.drawing.axes import screen_text, unbroken_units
from paretoik.review.palette import DRAWING
from paretoik.review.recording.messages import LeastViolating, RecordedMotion, Workcell, joint_curves
from paretoik.review.recording.recorder import Generation, Population, SearchedFront
from paretoik.review.words import counted, named_unit, run_text, value_text
from paretoik.search.maximin import dominates
from paretoik.task.limits import JOINT_UNITS, is_sliding, limit_ranges


def broken_limits(cell: Workcell, motion: RecordedMotion) -> list[str]:
    """Return a line of Markdown for every joint limit that a motion breaks, with the largest excess."""
    lines, time = list[str](), motion.time
    for kind, curves in joint_curves(cell, motion).items():
        if kind not in cell.bounds:
            continue
        bounds = cell.bounds[kind]
        if len(bounds) > 1:  # limits at the motion's samples; it may end before its path does
            bounds = bounds[np.abs(cell.times[:, None] - time).argmin(axis=0)]
        for joint, name in enumerate(cell.arm.joint_names):
            values, (low, high) = curves[:, joint], np.broadcast_to(bounds[:, joint], (len(time), 2)).T
            excess = np.maximum(values - high, low - values)
            over = excess > DRAWING.limit_tolerance * limit_ranges(low, high)
            if not over.any():
                continue
            worst, first = int(np.argmax(np.where(over, excess, -np.inf))), int(over.argmax())
            limit = high[worst] if values[worst] > high[worst] else low[worst]
            unit = JOINT_UNITS[kind][int(is_sliding(cell.arm)[joint])]
            lines.append(
                f"- **{name}, {kind}**: reaches {values[worst]:.3g} {unit} at {time[worst]:.3g} s, limit {limit:.3g} "
                f"{unit}; broken by up to {excess[worst]:.3g} {unit}, first at {time[first]:.3g} s, at {over.sum()} of "
                f"{len(time)} samples"
            )
    return lines


def infeasible_text(
    names: Sequence[str], units: Sequence[str], nearest: LeastViolating, cell: Workcell | None, heading: str
) -> str:
    """Return text on why a run has no result, and on broken constraints."""
    lines = [f"# {heading}", "", nearest.reason]
    if nearest.broken:
        lines += ["", "## Constraints broken", "", *(f"- {words}" for words in nearest.broken)]
    point = nearest.point
    limits = [] if cell is None or point is None or point.motion is None else broken_limits(cell, point.motion)
    lines += ["", "## Limits of joints broken", "", *limits] if limits else []
    if point is not None and np.isfinite(point.objectives).all():
        lines += ["", "## Its objectives", ""]
        lines += [
            f"- **{named_unit(name, unit)}**: {value_text(point.objectives[axis], unit)}"
            for axis, (name, unit) in enumerate(zip(names, units, strict=True))
        ]
    return screen_text(unbroken_units("\n".join(lines), units))


NO_RANGE = "A single point has no range: it is drawn in the middle."


def reason_text(choice: Choice) -> str:
    """Return the reason of a choice."""
    return screen_text(f"# Why point {choice.id}\n\n{choice.reason}")


def point_text(front: Front, row: int, *, chosen: Choice | None, title: str = "chosen", whole: bool = False) -> str:
    """Return the text of a row of a front: its objectives, certificate, exchange rates, and the run.

    The ``chosen`` point has a ``title`` and its reason, only the first bullet unless ``whole``.
    """
    certificates, units, reason = front.certificates, front.units, ""
    if chosen is None or chosen.index != row:
        title = f"number {row + 1} of {len(front)} along the front"
    else:
        first, *others = chosen.reason.splitlines()
        short = f"{first} The tab \u201cwhy\u201d has the comparisons with other points."
        reason = short if others and not whole else chosen.reason
    names = [named_unit(name, unit) for name, unit in zip(front.names, units, strict=True)]
    lines = [f"# Point {front.ids[row]}, {title}", "", "## Objectives", ""]
    for axis, name in enumerate(names):
        low, high = front.ranges[axis]
        share = f"{front.shares[row, axis]:.0%} of the way from the best to the worst"
        place = f"{low:.4g} to {value_text(high, units[axis])}, {share}" if high > low else "the only value"
        value, sense = value_text(front.objectives[row, axis], units[axis]), "more" if front.maximised[axis] else "less"
        lines.append(f"- **{name}, {sense} is better**: {value}; on the front {place}")
    lines += ["", "## Why", "", reason] if reason else []
    if certificates is not None:
        status, why = certificates.status[row], certificates.reason[row]
        lines += [
            "",
            "## Certificate",
            "",
            f"- {status} (local)" + (f": {why}" if why else ""),
            f"- criticality χ {certificates.criticality[row]:.2g} of the objectives' ranges: improvement still "
            "possible in all at once",
            f"- violation {certificates.violation[row]:.2g} at samples, {certificates.violation_between[row]:.2g} "
            "between, of a limit's range",
        ]
        errors = zip(front.names, units, certificates.discretisation_error[row], strict=True)
        texts = [f"{name} {value_text(error, unit)}" for name, unit, error in errors if np.isfinite(error)]
        lines += [f"- difference from the values of the curve: {', '.join(texts)}"] * bool(texts)
        rates = certificates.exchange_rates[row]
        known = [(i, j) for i, j in np.argwhere(np.isfinite(rates)).tolist() if i != j]
        lines += ["", "## Exchange rates", ""] if known else []
        lines += [
            f"- {value_text(1.0, units[i])} more of {names[i]}: {value_text(rates[i, j], units[j], sign='+')} "
            f"of {names[j]}"
            for i, j in known
        ]
    elif front.violation is not None:
        words = "No certificate: the point was not refined. Largest violation at samples: "
        lines += ["", "## Certificate", "", f"{words}{front.violation[row]:.2g} of a limit's range."]
    if run := run_text(front.provenance):
        lines += ["", run]
    if certificates is not None and front.provenance.get("settings", {}).get("refine"):
        lines += ["", "Curves over generations are those of the search, before its points were refined."]
    return screen_text(unbroken_units("\n".join(lines), units))


def step_text(scene: SearchedFront, step: Generation) -> str:
    """Return the text of a step of a closed loop."""
    lines = [f"# Step {step.number}", f"{counted(len(step.front), 'point')} on its front."]
    lines += ["", NO_RANGE, ""] if len(step.front) == 1 else []
    if step.chosen is not None and len(step.front):
        for name, unit, value, values in zip(scene.names, scene.units, step.chosen, step.front.T, strict=True):
            reach = range_text(values.min(), values.max(), unit)
            lines.append(f"- **{name}**: chosen {value_text(value, unit, digits=6)}; front: {reach}")
    return screen_text("\n".join(lines))


def text_of(
    scene: SearchedFront,
    generation: Generation,
    moved: int | None = None,
    *,
    outside: int = 0,
    end: str = "the final front",
) -> str:
    """Return the text of a generation and its compromise.

    ``moved``: the generation whose motions are shown with it. ``outside``: number of individuals outside the axes,
    which show the neighbourhood of the ``end``.
    """
    number, front, units = generation.number, generation.front, scene.units
    count, heading = generation.count, f"{scene.timeline.capitalize()} {number}"
    if scene.timeline == "refinement":
        heading = "Before" if generation.origins is None else "After"
    summary = f"{counted(count, 'point')} on the front"
    if generation.hypervolume is not None:
        summary += f", hypervolume {generation.hypervolume:.4g} {scene.volume_unit}"
    lines = [
        f"# {heading}",
        summary + (f"; {generation.failed} evaluations failed so far." * (generation.failed > 0) or "."),
    ]
    if not count and not len(generation.population):
        lines += ["", "Nothing could be evaluated yet."]
    elif not count:
        individuals = counted(len(generation.population), "individual")
        reason = f"None of the {individuals} satisfies all limits and constraints of the problem"
        lines += ["", f"{reason}, as points of a front must."]
        if generation.least_violating is not None:
            lines += ["", "Constraints broken by the least-violating individual so far:", ""]
            lines += [f"- {words}" for words in generation.least_violating.broken]
    if generation.epsilon is not None:
        bounds = [
            f"{name} {'≥' if more else '≤'} {value_text(bound, unit)}"
            for name, unit, more, bound in zip(scene.names, units, scene.maximised, generation.epsilon, strict=True)
            if np.isfinite(bound)
        ]
        words = f"The other objective was improved as far as these bounds ε allow: {', '.join(bounds)}."
        lines += ["", words, ""] if bounds else []
    compromise = next((point for point in generation.points if point.axis is None), None)
    for axis, name in enumerate(scene.names if len(front) else ()):
        line = f"- **{named_unit(name, units[axis])}**: best {value_text(scene.best(front)[axis], units[axis])}"
        if compromise is not None:
            line += f", compromise {value_text(compromise.objectives[axis], units[axis])}"
        lines.append(line)
    if compromise is not None:
        name = f"point {compromise.id}"
        if scene.timeline == "level":
            name += f" of level {number} (the final front renumbers its points)"
        lines += ["", f"The compromise, {name}, is {COMPROMISE_IN_WORDS}."]
    if moved is not None and moved != number:
        words = "Only some generations are recorded with motions, to save time: the arm shows those of generation"
        lines += ["", f"{words} {moved}."]
    lines += outside_text(outside, len(generation.population), end)
    lines += ["", better_but_infeasible(scene, generation.population, front)]
    return screen_text(unbroken_units("\n".join(lines).rstrip(), units))


def outside_text(outside: int, count: int, what: str) -> list[str]:
    """Return lines on individuals outside the axes; none if all are inside."""
    verb = "is" if outside == 1 else "are"
    words = f"{outside} of {counted(count, 'individual')} {verb} outside the axes, which show the region around {what}."
    return ["", words] if outside else []


def better_but_infeasible(scene: SearchedFront, population: Population, front: Objectives) -> str:
    """Return text on the number of individuals that dominate the front; these are infeasible.

    The text is "" if there are none.
    """
    if scene.timeline != "generation" or not len(front):
        return ""
    signs = np.where(scene.maximised, -1.0, 1.0)
    count = int(dominates((population * signs)[:, None], (front * signs)[None]).any(axis=1).sum())
    verb = "looks better than the front and breaks" if count == 1 else "look better than the front and break"
    return f"{counted(count, 'individual')} {verb} a limit or a constraint." if count else ""


def range_text(low: float, high: float, unit: str) -> str:
    """Return a range in words; if both ends have the same digits, the upper one as an offset.

    >>> range_text(1.0, 2.0, "m"), range_text(1.0, 1.0 + 1e-9, "m"), range_text(1.0, 1.0, "m")
    ('1 to 2 m', '1 m to 1e-09 m above that', '1 m only')
    """
    first, width = value_text(low, unit, digits=6), value_text(high - low, unit, digits=3)
    if low == high:
        return f"{first} only"
    if f"{low:.6g}" == f"{high:.6g}":
        return f"{first} to {width} above that"
    return f"{low:.6g} to {value_text(high, unit, digits=6)}"

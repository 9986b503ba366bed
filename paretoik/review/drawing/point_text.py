"""The text of a point of a front, in Markdown."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from paretoik.arrays import Objectives
from paretoik.front.choice import Choice
from paretoik.front.front import Front
from paretoik.front.preferences.compromise import COMPROMISE_IN_WORDS
from paretoik.review.drawing.axes import screen_text, unbroken_units
from paretoik.review.drawing.scatter import SearchScene
from paretoik.review.drawing.search_charts import front_size
from paretoik.review.palette import DRAWING, is_sliding
from paretoik.review.recording.messages import LeastViolating, RecordedMotion, Workcell, joint_curves
from paretoik.review.recording.recorder import Generation, Population
from paretoik.review.words import counted, named_unit, run_text, value_text
from paretoik.search.maximin import dominates
from paretoik.task.limits import JOINT_UNITS, limit_ranges

# Joint limits that a motion breaks, in words: a method may not know them, and its result then shows it.


def broken_limits(cell: Workcell, motion: RecordedMotion) -> list[str]:
    """Return a line of Markdown for every joint limit that a motion breaks, with the largest excess."""
    lines, time = list[str](), motion.time
    for kind, curves in joint_curves(cell, motion).items():
        if kind not in cell.bounds:
            continue
        bounds = cell.bounds[kind]
        if len(bounds) > 1:  # those at the samples of a motion, which may end before its path does
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


# The text, in Markdown, of a run without a feasible result: the reason, and the broken constraints.


def infeasible_text(
    names: Sequence[str], units: Sequence[str], nearest: LeastViolating, cell: Workcell | None, heading: str
) -> str:
    """Return why a run has no result, and what its least-violating motion breaks; joint limits have their units.

    ``names`` and ``units`` are those of the objectives.
    """
    lines = [f"# {heading}", "", nearest.reason]
    if nearest.broken:
        lines += ["", "## Constraints broken", "", *broken_lines(nearest)]
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


def broken_lines(nearest: LeastViolating) -> list[str]:
    """Return a line of Markdown for every constraint that is broken."""
    return [f"- {words}" for words in nearest.broken]


# Texts of points and choices, in Markdown.


NO_RANGE = "One point has no range to have a share of: it is drawn in the middle."


def choice_text(front: Front, choice: Choice, *, title: str = "chosen", whole: bool = True) -> str:
    """Return the text of a choice: its reason, objectives, certificate, exchange rates, and the run.

    Only the first sentence of the reason is included unless ``whole``.
    """
    first, *others = _sentences(choice.reason)
    reason = choice.reason
    if others and not whole:
        reason = f"{first} The tab \u201cwhy\u201d has the comparisons with other points."
    return _point_text(front, choice.index, title, reason)


def reason_text(choice: Choice) -> str:
    """Return the reason of a choice, one line per sentence."""
    lines = [f"- {sentence}" for sentence in _sentences(choice.reason)]
    return screen_text("\n".join([f"# Why point {choice.id}", "", *lines]))


def _sentences(words: str) -> list[str]:
    """Return the sentences of a text.

    >>> _sentences("It has 0.5 J s. Beside it, point 3 has 2.")
    ['It has 0.5 J s.', 'Beside it, point 3 has 2.']
    """
    return re.split(r"(?<=[.;]) (?=[A-Z])", words)


def point_text(front: Front, row: int, *, chosen: Choice | None) -> str:
    """Return the text of any point of a front."""
    if chosen is not None and chosen.index == row:
        return choice_text(front, chosen, whole=False)
    return _point_text(front, row, f"number {row + 1} of {len(front)} along the front", "")


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
    if front.certificates is not None and front.provenance.get("settings", {}).get("refine"):
        parts.append("Curves over generations are those of the search, before its points were refined.")
    return screen_text(unbroken_units("\n\n".join(part for part in parts if part), front.units))


def text_of(
    scene: SearchScene,
    generation: Generation,
    moved: int | None = None,
    *,
    outside: int = 0,
    end: str = "the final front",
) -> str:
    """Return the text of a generation and its compromise, or of a step of a closed loop.

    ``moved``: the generation whose motions are shown with it. ``outside``: number of individuals outside the axes,
    which show the neighbourhood of the ``end``.
    """
    if scene.timeline == "step":
        return screen_text(_step_text(scene, generation))
    better = better_but_infeasible(scene, generation.population, generation.front)
    notes = [*outside_text(outside, len(generation.population), end), "", better]
    words = "\n".join([_generation_text(scene, generation, moved), *notes]).rstrip()
    return screen_text(unbroken_units(words, scene.units))


def outside_text(outside: int, count: int, what: str) -> list[str]:
    """Return how many of ``count`` individuals are outside the axes, which show ``what``; nothing if none are."""
    verb = "lies" if outside == 1 else "lie"
    words = f"{outside} of {counted(count, 'individual')} {verb} outside the axes, which show what is near {what}."
    return ["", words] if outside else []


def better_but_infeasible(scene: SearchScene, population: Population, front: Objectives) -> str:
    """Return how many individuals dominate the front without being on it; these are infeasible.

    "" if there are none.
    """
    if scene.timeline != "generation" or not len(front):
        return ""
    signs = np.where(scene.maximised, -1.0, 1.0)
    count = int(dominates((population * signs)[:, None], (front * signs)[None]).any(axis=1).sum())
    verb = "looks better than the front and breaks" if count == 1 else "look better than the front and break"
    return f"{counted(count, 'individual')} {verb} a limit or a constraint." if count else ""


def _generation_text(scene: SearchScene, generation: Generation, moved: int | None) -> str:
    size = front_size(generation)
    summary = f"{counted(size, 'point')} on the front"
    if generation.hypervolume is not None:
        summary += f", hypervolume {generation.hypervolume:.4g} {scene.volume_unit}"
    summary += f"; {generation.failed} evaluations failed so far." if generation.failed else "."
    heading = f"{scene.timeline.capitalize()} {generation.number}"
    if scene.timeline == "refinement":
        heading = "Before" if generation.origins is None else "After"
    lines = [f"# {heading}", summary]
    if not size:
        lines += ["", _why_empty(generation)]
    lines += _bounds(scene, generation)
    chosen = next((point for point in generation.points if point.axis is None), None)
    if len(generation.front):
        best = scene.best(generation.front)
        lines += [
            f"- **{named_unit(name, unit)}**: best {value_text(best[axis], unit)}"
            + ("" if chosen is None else f", compromise {value_text(chosen.objectives[axis], unit)}")
            for axis, (name, unit) in enumerate(zip(scene.names, scene.units, strict=True))
        ]
    if chosen is not None:
        name = f"point {chosen.id}"
        if scene.timeline == "level":
            name += f" of level {generation.number} (the final front renumbers its points)"
        lines += ["", f"The compromise, {name}, is {COMPROMISE_IN_WORDS}."]
    if moved is not None and moved != generation.number:
        lines += [
            "",
            "The search is not slowed to record motions of every generation: the arm shows those of generation "
            f"{moved}.",
        ]
    return "\n".join(lines)


def beginning_text(first: int) -> str:
    """Return the text of a closed loop before its ``first`` step."""
    return (
        f"# Step 0\n\nThe arm stands where it begins: nothing was searched for, so there is no front. "
        f"The first is that of step {first}."
    )


def search_hint(searched: Sequence[int]) -> str:
    """Return where the timelines of searched steps are visible."""
    tabs = " and ".join(f"\u201csearch of step {step}\u201d" for step in searched)
    return f"**This timeline moves {tabs}: open that tab above the legend.**"


def loop_guide(searched: Sequence[int], opening: int | None) -> str:
    """Return where the search of each given step is visible, and from which step on the loop is played."""
    lines = [
        f"- The search of step {step} has a tab, \u201csearch of step {step}\u201d, above the legend; the timelines "
        "generation and individual move it and leave all else as it is."
        for step in searched
    ]
    if opening:
        lines.append(
            f"- The steps from {opening} on, blue on the slider, are played again and again; those before are left of "
            "them. The loop button plays all."
        )
    return "## How to look at it\n\n" + "\n".join(lines) if lines else ""


def _bounds(scene: SearchScene, generation: Generation) -> list[str]:
    """Return the bounds of a level of a sweep."""
    if generation.epsilon is None:
        return []
    bounds = [
        f"{scene.names[axis]} {'≥' if scene.maximised[axis] else '≤'} {value_text(bound, scene.units[axis])}"
        for axis, bound in enumerate(generation.epsilon)
        if np.isfinite(bound)
    ]
    words = f"The other objective was improved as far as these bounds ε allow: {', '.join(bounds)}."
    return ["", words, ""] if bounds else []


def _why_empty(generation: Generation) -> str:
    count = len(generation.population)
    if not count:
        return "Nothing could be evaluated yet."
    words = (
        f"None of the {counted(count, 'individual')} keeps all limits and constraints of the problem: a front has only "
        "points that do."
    )
    if generation.least_violating is None:
        return words
    broken = "Constraints broken by the least-violating individual so far:"
    return "\n".join([words, "", broken, "", *broken_lines(generation.least_violating)])


def _step_text(scene: SearchScene, generation: Generation) -> str:
    count = len(generation.front)
    lines = [f"# Step {generation.number}", f"{counted(count, 'point')} on its front."]
    if count == 1:
        lines += ["", NO_RANGE, ""]
    if generation.chosen is not None and len(generation.front):
        low, high = generation.front.min(axis=0), generation.front.max(axis=0)
        lines += [
            f"- **{name}**: chosen {value_text(generation.chosen[axis], unit, digits=6)}; front: "
            f"{range_text(low[axis], high[axis], unit)}"
            for axis, (name, unit) in enumerate(zip(scene.names, scene.units, strict=True))
        ]
    return "\n".join(lines)


def _objectives(front: Front, row: int) -> str:
    lines = ["## Objectives", ""]
    for axis, name in enumerate(front.names):
        low, high = front.ranges[axis]
        sense, unit = "more" if front.maximised[axis] else "less", front.units[axis]
        share = f"{front.shares[row, axis]:.0%} of the way from the best to the worst"
        place = f"{low:.4g} to {value_text(high, unit)}, {share}" if high > low else "the only value"
        value = value_text(front.objectives[row, axis], unit)
        lines.append(f"- **{named_unit(name, unit)}, {sense} is better**: {value}; on the front {place}")
    return "\n".join(lines)


def _certificate(front: Front, row: int) -> str:
    certificates = front.certificates
    assert certificates is not None
    lines = [
        f"- {certificates.status[row]} (local)" + (f": {certificates.reason[row]}" if certificates.reason[row] else ""),
        f"- criticality χ {certificates.criticality[row]:.2g} of the objectives' ranges: what all could still gain at "
        "once",
        f"- violation {certificates.violation[row]:.2g} at samples, {certificates.violation_between[row]:.2g} between, "
        "of a limit's range",
    ]
    errors = zip(front.names, front.units, certificates.discretisation_error[row], strict=True)
    texts = [f"{name} {value_text(error, unit)}" for name, unit, error in errors if np.isfinite(error)]
    lines += [f"- off the values of the curve by {', '.join(texts)}"] * bool(texts)
    return "## Certificate\n\n" + "\n".join(lines)


def _rates(front: Front, row: int) -> str:
    certificates = front.certificates
    assert certificates is not None
    rates = certificates.exchange_rates[row]
    names = [named_unit(name, unit) for name, unit in zip(front.names, front.units, strict=True)]
    lines = [
        f"- {value_text(1.0, front.units[i])} more of {names[i]}: "
        f"{value_text(rates[i, j], front.units[j], sign='+')} of {names[j]}"
        for i in range(len(front.names))
        for j in range(len(front.names))
        if i != j and np.isfinite(rates[i, j])
    ]
    return "## Exchange rates\n\n" + "\n".join(lines) if lines else ""


def range_text(low: float, high: float, unit: str) -> str:
    """Return a range in words; if its ends have the same digits, the upper end is relative to the lower one.

    >>> range_text(1.0, 2.0, "m"), range_text(1.0, 1.0 + 1e-9, "m"), range_text(1.0, 1.0, "m")
    ('1 to 2 m', '1 m to 1e-09 m above that', '1 m alone')
    """
    first, width = value_text(low, unit, digits=6), value_text(high - low, unit, digits=3)
    if low == high:
        return f"{first} alone"
    if f"{low:.6g}" == f"{high:.6g}":
        return f"{first} to {width} above that"
    return f"{low:.6g} to {value_text(high, unit, digits=6)}"

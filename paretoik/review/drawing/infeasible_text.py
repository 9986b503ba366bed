"""What is said, in Markdown, of a run that found nothing feasible: the reason, and what the least-violating breaks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from paretoik.review.drawing.broken_limits import broken_limits
from paretoik.review.drawing.screen_text import screen_text, unbroken_units
from paretoik.review.recording.least_violating import LeastViolating
from paretoik.review.recording.workcell import Workcell
from paretoik.review.run_words import named_unit, value_text


def infeasible_text(
    names: Sequence[str], units: Sequence[str], nearest: LeastViolating, cell: Workcell | None, heading: str
) -> str:
    """Return why a run has no result, and what its least-violating motion breaks, limits of joints in their units.

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

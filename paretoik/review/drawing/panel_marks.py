"""The best points of the objectives in a panel of two of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from jaxtyping import Float

from paretoik.arrays import Objectives
from paretoik.review.drawing.drawn_axes import Canvas
from paretoik.review.drawing.label_places import log_name
from paretoik.review.drawing.screen_text import screen_text
from paretoik.review.drawing_options import MARKS
from paretoik.review.palette import SCREEN
from paretoik.review.recording.recorded_point import RecordedPoint
from paretoik.review.recording.recorder import Population


def log_ends(
    recording: rr.RecordingStream,
    entity: Sequence[str],
    canvas: Canvas,
    places: Objectives,
    points: Sequence[RecordedPoint],
    names: Sequence[str],
    others: Population | None,
    *,
    of: str = "",
    taken: Float[np.ndarray, "area 2"] | None = None,
) -> None:
    """Mark the best points of the objectives called ``names`` at their ``places`` (points, 2), at the current time.

    Of those that are one point, or the chosen one, every mark is a ring around the next, and their names stand beside
    them, off ``others`` (points, 2) and what is ``taken`` [pixels], unless the former are None. ``of`` says whose ids
    they have.
    """
    ends = [row for row, point in enumerate(points) if point.axis is not None]
    chosen = {point.id for point in points if point.axis is None}
    marks, radii, hovered, shared = list[int](), list[float](), list[str](), dict[str, int]()
    for row in ends:
        same = [other for other in ends if points[other].id == points[row].id]
        if canvas.shows(places[row : row + 1])[0]:
            words = best_words(points, row, names)
            marks.append(row)
            radii.append(MARKS.end + MARKS.ring * (len(same) - 1 - same.index(row) + (points[row].id in chosen)))
            hovered.append(f"point {points[row].id}{of}, {', '.join(words.splitlines())}")
            if len(same) > 1 and points[row].id not in chosen:
                shared[words] = row
    colours, sizes = [SCREEN.end(points[row].axis or 0) for row in marks], rr.Radius.ui_points(radii)
    at = canvas.place(places[marks])
    markers = rr.Points2D(at, colors=colours, radii=sizes, labels=hovered, show_labels=False, draw_order=3.0)
    recording.log([*entity, "ends"], markers)
    if others is None:
        return
    for number in range(max(1, len(names) // 2)):  # as many as there can be
        shown, rows = list(shared)[number : number + 1], list(shared.values())[number : number + 1]
        everything = np.concatenate([places[rows], others, places])
        log_name(recording, [*entity, "ends", f"names_{number}"], canvas, shown, everything, SCREEN.text, taken=taken)


def best_words(points: Sequence[RecordedPoint], row: int, names: Sequence[str]) -> str:
    """Return what the point of a row is best in, a line an objective."""
    same = [point.axis for point in points if point.axis is not None and point.id == points[row].id]
    return "\n".join(f"best {screen_text(names[axis])}" for axis in same)

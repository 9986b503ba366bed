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

    Of those that lie on each other, or on the chosen one, every mark is a ring around the next. The names of those that
    are one point stand beside it, off ``others`` (points, 2) and what is ``taken`` [pixels], unless the former are
    None. ``of`` says whose ids they have.
    """
    ends = [row for row, point in enumerate(points) if point.axis is not None]
    chosen = {point.id for point in points if point.axis is None}
    marks, hovered, shared = list[int](), list[str](), dict[str, int]()
    for row in ends:
        if canvas.shows(places[row : row + 1])[0]:
            words = best_words(points, row, names)
            marks.append(row)
            hovered.append(f"point {points[row].id}{of}, {', '.join(words.splitlines())}")
            if "\n" in words and points[row].id not in chosen:
                shared[words] = row
    radii = ring_radii(canvas.place(places), marks, [row for row, point in enumerate(points) if point.axis is None])
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


def ring_radii(
    at: Float[np.ndarray, "points 2"], marks: Sequence[int], chosen: Sequence[int]
) -> Float[np.ndarray, " marks"]:
    """Return the radii of marks [pixels] at their places among those of points: wider by a ring for each on top."""
    apart = np.linalg.norm(at[list(marks), None] - at[[*marks, *chosen]], axis=2)
    on_top = np.triu(apart < MARKS.end, k=1).sum(axis=1)  # a later mark is drawn above, the chosen point above all
    return np.asarray(MARKS.end + MARKS.ring * on_top, dtype=float)


def best_words(points: Sequence[RecordedPoint], row: int, names: Sequence[str]) -> str:
    """Return what the point of a row is best in, a line an objective."""
    same = [point.axis for point in points if point.axis is not None and point.id == points[row].id]
    return "\n".join(f"best {screen_text(names[axis])}" for axis in same)

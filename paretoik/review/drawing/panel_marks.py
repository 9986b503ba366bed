"""What else a panel of two objectives shows: best points, bounds ε of a sweep, where refined ones came from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from jaxtyping import Float

from paretoik.arrays import Objectives, Values
from paretoik.review.drawing.drawn_axes import TEXT, Canvas, labels, text_width
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
) -> None:
    """Mark the best points of the objectives called ``names`` at their ``places`` (points, 2), at the current time.

    Of those that are one point, or the chosen one, every mark is a ring around the next, and their names stand beside
    them, off ``others`` (points, 2), unless these are None. ``of`` says whose ids they have.
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
        log_name(recording, [*entity, "ends", f"names_{number}"], canvas, shown, everything, SCREEN.text)


def best_words(points: Sequence[RecordedPoint], row: int, names: Sequence[str]) -> str:
    """Return what the point of a row is best in, a line an objective."""
    same = [point.axis for point in points if point.axis is not None and point.id == points[row].id]
    return "\n".join(f"best {screen_text(names[axis])}" for axis in same)


def log_epsilon(
    recording: rr.RecordingStream,
    entity: Sequence[str],
    canvas: Canvas,
    epsilon: Values | None,
    labelled: tuple[tuple[str, str], tuple[str, str]],
    maximised: tuple[bool, bool],
) -> None:
    """Draw the finite bounds of the two objectives of a panel at the current time; none where ``epsilon`` is None.

    ``labelled`` are names and units. What a bound is stands beside the end of its line, within the frame.
    """
    strips, words, places = list[np.ndarray](), list[str](), list[np.ndarray]()
    for axis in range(2) if epsilon is not None else ():
        assert epsilon is not None
        bound = epsilon[axis]
        if not (np.isfinite(bound) and canvas.low[axis] <= bound <= canvas.high[axis]):
            continue
        line = np.stack([canvas.low, canvas.high])
        line[:, axis] = bound
        strips.append(canvas.place(line))
        (name, unit), sense = labelled[axis], "≥" if maximised[axis] else "≤"
        words.append(f"ε: {name} {sense} {bound:.4g} {unit}".rstrip())
        places.append(_end_label_place(canvas, strips[-1], words[-1]))
    lines = rr.LineStrips2D(strips, colors=SCREEN.epsilon, radii=rr.Radius.ui_points(1.0), draw_order=0.5)
    recording.log(list(entity), lines)
    recording.log([*entity, "names"], labels(words, np.array(places).reshape(-1, 2), SCREEN.epsilon))


def bound_points(pair: tuple[int, int], canvas: Canvas, epsilon: Values) -> Float[np.ndarray, "points n_obj"]:
    """Return points along the finite bounds in the panel of a pair, NaN in others: labels are to keep off them."""
    lines = [np.zeros((0, len(epsilon)))]
    for axis in pair:
        if np.isfinite(epsilon[axis]):
            line = np.full((40, len(epsilon)), np.nan)
            line[:, list(pair)] = np.linspace(canvas.low, canvas.high, len(line))
            line[:, axis] = epsilon[axis]
            lines.append(line)
    return np.concatenate(lines)


def _end_label_place(canvas: Canvas, strip: np.ndarray, words: str) -> np.ndarray:
    """Return the middle of words beside a line across a panel: where it ends, on the side that has more room."""
    offset = np.array([0.5 * text_width(words) + 14.0, 0.5 * TEXT.line + 4.0])
    end, middle = strip[-1], canvas.origin + 0.5 * np.array([canvas.width, canvas.height])
    inwards = np.where(end > middle, -1.0, 1.0)
    return np.asarray(end + inwards * offset)


def log_moves(
    recording: rr.RecordingStream,
    entity: Sequence[str],
    canvas: Canvas,
    origins: Objectives | None,
    front: Objectives,
) -> None:
    """Draw an arrow from where each point (points, 2) was to where it is, at the current time; none without origins."""
    origins = front[:0] if origins is None else origins
    seen = canvas.shows(origins) & canvas.shows(front[: len(origins)])
    tails, tips = canvas.place(origins[seen]), canvas.place(front[: len(origins)][seen])
    arrows = rr.Arrows2D(
        origins=tails, vectors=tips - tails, colors=SCREEN.moves, radii=rr.Radius.ui_points(0.8), draw_order=1.5
    )
    recording.log(list(entity), arrows)

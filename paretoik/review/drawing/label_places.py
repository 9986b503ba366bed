"""Where the label of a mark covers least of what else is drawn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from jaxtyping import Float

from paretoik.arrays import Objectives, Values
from paretoik.review.drawing.drawn_axes import TEXT, Canvas, labels, text_width
from paretoik.review.drawing_options import MARKS
from paretoik.review.palette import Colour

Labelled = tuple[Values, str]  # the objectives of a point and what its label says
SIDES = np.array([(1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (-1, -1), (1, 1), (-1, 1)], dtype=float)


def label_place(
    canvas: Canvas, mark: Float[np.ndarray, " 2"], words: str, others: Float[np.ndarray, "marks 2"]
) -> Float[np.ndarray, " 2"]:
    """Return the middle of the label of a `mark` that covers fewest of ``others``, all [pixels]; the nearest of such.

    It lies within the frame wherever that has room.
    """
    lines = words.split("\n")
    half = np.array([0.5 * text_width(max(lines, key=len)) + 8.0, 0.5 * TEXT.line + _below_first(words)])
    low, high = canvas.origin, canvas.origin + np.array([canvas.width, canvas.height])
    middles = np.concatenate(
        [mark + SIDES * (half + MARKS.clearance + (step - 1.0) * TEXT.line) for step in MARKS.label_steps]
    )
    covered = (np.abs(others[None] - middles[:, None]) < half + 4.0).all(axis=2).sum(axis=1)
    outside = ((middles - half < low) | (middles + half > high)).any(axis=1)
    return np.asarray(middles[(covered + MARKS.outside * outside).argmin()])


def label_points(
    canvas: Canvas, mark: Float[np.ndarray, " 2"], words: str, others: Float[np.ndarray, "marks 2"]
) -> Float[np.ndarray, "area 2"]:
    """Return points all over the label of a `mark`, for others to keep clear of."""
    middle, longest = label_place(canvas, mark, words, others), max(words.split("\n"), key=len)
    wide = np.array([0.5 * text_width(longest), 0.4 * TEXT.line + _below_first(words)])
    grid = np.stack(np.meshgrid(np.linspace(-1.0, 1.0, 9), np.linspace(-1.0, 1.0, 3)), axis=-1).reshape(-1, 2)
    return np.asarray(middle + wide * grid)


def named_area(
    canvas: Canvas, labelled: Labelled, columns: list[int], avoided: Objectives | None
) -> Float[np.ndarray, "area 2"]:
    """Return points all over the label of a point that is off what is ``avoided``; none where it is not shown."""
    place, words = labelled
    places = place[None, columns]
    at = canvas.place(places if avoided is None else np.concatenate([places, avoided[:, columns]]))
    return label_points(canvas, at[0], words, at) if canvas.shows(places)[0] else at[:0]


def placed_label(canvas: Canvas, mark: np.ndarray, words: str, others: np.ndarray, colour: Colour) -> rr.Points2D:
    """Return the label of a `mark` at the best place for it."""
    first = label_place(canvas, mark, words, others) - (0.0, _below_first(words))
    return labels([words], first[None], colour)


def log_name(
    recording: rr.RecordingStream,
    entity: Sequence[str],
    canvas: Canvas,
    words: Sequence[str] | None,
    places: Float[np.ndarray, "points 2"],
    colour: Colour,
    static: bool = False,
    taken: Float[np.ndarray, "area 2"] | None = None,
) -> None:
    """Label the first of some places, off all of them, with the first of ``words``; without, take its label away.

    It has none where the `canvas` does not show its place. What is ``taken`` [pixels] belongs to another label.
    """
    at, label = canvas.place(places), rr.Points2D([])
    if words and canvas.shows(places[:1])[0]:
        others = at if taken is None else np.concatenate([at, taken])
        label = placed_label(canvas, at[0], words[0], others, colour)
    recording.log(list(entity), label, static=static)


def _below_first(words: str) -> float:
    """Return how far the middle of words lies below that of their first line [pixels]."""
    return 0.5 * MARKS.label_line * words.count("\n")

"""The place of a mark's label that covers least of what else is drawn, and the line between the two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import rerun as rr
from jaxtyping import Float

from paretoik.arrays import Mask, Objectives, Values
from paretoik.review.drawing.axes import TEXT, Canvas, labels
from paretoik.review.outlines import (
    NO_LINES,
    Lines,
    Point,
    count_covered,
    count_crossed,
    count_touched,
    freest_place,
    places_beside,
    places_between,
)
from paretoik.review.palette import MARKS, Colour

# The sizes of labels as the viewer draws them: words on a plate, in letters of different widths.


@dataclass(frozen=True, kw_only=True)
class LabelOptions:
    """Sizes of labels [pixels], measured in pictures of the viewer."""

    height: float = 12.5  # of the viewer's font, Inter
    letters: tuple[tuple[float, str], ...] = (  # widths of groups of letters, as shares of the height
        (0.24, "ijlI'"),
        (0.28, " .,:;!·"),
        (0.365, "frt()[]{}/|"),
        (0.45, "1-_²³"),
        (0.55, "aceksvxyzε?"),
        (0.66, "ABKPRSTVXY+<=>≤≥~"),
        (0.74, "CDGHNOQU"),
        (0.87, "mwMW%@↑"),
    )
    usual: float = 0.61  # width of letters that are in none of the groups
    line: float = 15.0  # distance between lines
    padding: tuple[float, float] = (11.0, 8.0)  # how much larger the plate is than the words, across and upwards
    reserve: float = 1.06  # factor of a label's size: a smaller window draws the frame smaller, but not the label


Points: TypeAlias = Float[np.ndarray, "_ 2"]  # any number of points [pixels]
LABEL = LabelOptions()
SHARES = {letter: share for share, letters in LABEL.letters for letter in letters}


def plate_half(words: str) -> Point:
    """Return half the width and height of a label's plate [pixels]."""
    lines = words.split("\n")
    widths = [LABEL.height * sum(SHARES.get(letter, LABEL.usual) for letter in line) for line in lines]
    return 0.5 * (np.array([max(widths), LABEL.line * len(lines)]) + LABEL.padding)


def half_size(words: str) -> Point:
    """Return half the width and height that a label needs [pixels], also in a smaller window."""
    return LABEL.reserve * plate_half(words)


def below_first(words: str) -> float:
    """Return how far the middle of words is below the middle of their first line [pixels]."""
    return 0.5 * LABEL.line * words.count("\n")


# The place of a label, and the line to its mark.


Labelled = tuple[Values, str]  # the objectives of a point and what its label says
DrawnLabel: TypeAlias = tuple[rr.Points2D, rr.LineStrips2D]  # the words, and the line from them to their mark


def label_place(canvas: Canvas, mark: Point, words: str, others: Points) -> Point:
    """Return the nearest middle of a `mark`'s label that covers the fewest of ``others``, all [pixels].

    It is within the frame if there is space.
    """
    half = half_size(words)
    height = 2.0 * float(half[1]) + MARKS.label_gap
    distances = tuple(MARKS.clearance + (step - 1.0) * height for step in MARKS.label_steps)
    middles = places_beside(mark, half, distances)
    covered = count_covered(middles, half, others, gap=MARKS.label_gap)
    return np.asarray(middles[(covered + MARKS.outside * ~_is_inside(canvas, middles, half)).argmin()])


def separate_label_places(canvas: Canvas, marks: Points, words: Sequence[str], others: Points) -> Points:
    """Return the middles of the labels of ``marks`` [pixels], which avoid ``others`` and earlier labels."""
    middles = np.zeros((len(marks), 2))
    for row, mark in enumerate(marks):
        middles[row] = label_place(canvas, mark, words[row], others)
        others = np.concatenate([others, label_area(middles[row], words[row])])
    return middles


def joined_label_place(canvas: Canvas, mark: Point, words: str, others: Points, lines: Lines = NO_LINES) -> Point:
    """Return the middle of a `mark`'s label; if no place next to the mark is free, it is farther away, with a line.

    Farther places are first all those in the frame, then those of the margins, which only contain the vertical axis
    label. If possible, the line crosses none of ``lines`` and touches none of ``others``.
    """
    others = np.concatenate([others, _title_area(canvas)])
    half, near = half_size(words), label_place(canvas, mark, words, others)
    end = np.clip(mark, near - half, near + half)[None]
    inside = near[None][_is_inside(canvas, near[None], half)]
    is_covering = count_covered(near[None], half, others, gap=MARKS.label_gap).any()
    is_touching = _has_line(mark, end[0]) and count_touched(mark, end, others, MARKS.end).any()
    if len(inside) and not is_covering and not is_touching and not count_crossed(mark, end, lines).any():
        return near
    middles = np.concatenate([inside, _frame_places(canvas, half), _margin_places(canvas, half)])
    if not len(middles):
        return near
    return freest_place(middles, half, mark, others, MARKS.label_gap, lines, reach=MARKS.end)


def label_points(canvas: Canvas, mark: Point, words: str, others: Points) -> Points:
    """Return points on the joined label of a `mark`, which others must avoid."""
    return label_area(joined_label_place(canvas, mark, words, others), words)


def label_lines(mark: Point, middle: Point, words: str) -> Lines:
    """Return the line from a `mark` to its label, and the label's diagonals, which other lines must not cross."""
    half = half_size(words)
    across = half * [1.0, -1.0]
    return np.array([[mark, middle], [middle - half, middle + half], [middle - across, middle + across]])


def label_area(middle: Point, words: str) -> Points:
    """Return points on a label around its `middle`."""
    grid = np.stack(np.meshgrid(np.linspace(-1.0, 1.0, 9), np.linspace(-1.0, 1.0, 3)), axis=-1).reshape(-1, 2)
    return np.asarray(middle + plate_half(words) * grid)


def named_area(
    canvas: Canvas,
    labelled: Labelled | None,
    columns: list[int],
    avoided: Objectives | None,
    taken: Points | None = None,
) -> tuple[Points, Lines]:
    """Return ``taken`` [pixels] plus the label of a point, which avoids it and ``avoided``, and the label's lines.

    A point that is not shown, or None, has no label.
    """
    area = np.zeros((0, 2)) if taken is None else taken
    if labelled is None or not canvas.shows(labelled[0][None, columns])[0]:
        return area, NO_LINES
    places, words = labelled[0][None, columns], labelled[1]
    at = canvas.place(places if avoided is None else np.concatenate([places, avoided[:, columns]]))
    others = np.concatenate([at, area])
    middle = joined_label_place(canvas, at[0], words, others)
    return np.concatenate([area, label_area(middle, words)]), label_lines(at[0], middle, words)


def joined_label(
    canvas: Canvas, mark: np.ndarray, words: str, others: np.ndarray, colour: Colour, lines: Lines = NO_LINES
) -> DrawnLabel:
    """Return the label of a `mark` at its best place, with a line to it if it is farther away."""
    middle, half = joined_label_place(canvas, mark, words, others, lines), half_size(words)
    within = plate_half(words) - MARKS.overlap
    tip = np.clip(mark, middle - within, middle + within)
    joins = [np.stack([mark, tip])] if _has_line(mark, np.clip(mark, middle - half, middle + half)) else []
    line = rr.LineStrips2D(joins, colors=colour, radii=rr.Radius.ui_points(0.6), draw_order=3.8)
    return labels([words], (middle - (0.0, below_first(words)))[None], colour), line


def no_label() -> DrawnLabel:
    """Return what removes a label."""
    return rr.Points2D([]), rr.LineStrips2D([])


def line_points(ends: Float[np.ndarray, "lines 2 2"]) -> Points:
    """Return points along lines [pixels], so close that no label fits between two of them."""
    shares = np.linspace(0.0, 1.0, MARKS.line_points)[:, None]
    return np.concatenate([np.zeros((0, 2)), *(start + shares * (end - start) for start, end in ends)])


def log_name(
    recording: rr.RecordingStream,
    entity: Sequence[str],
    canvas: Canvas,
    words: str,
    places: Points,
    colour: Colour,
    static: bool = False,
    taken: Points | None = None,
    lines: Lines = NO_LINES,
) -> None:
    """Label the first of some places and avoid all of them; without words, remove the label.

    There is no label if the `canvas` does not show the place. ``taken`` [pixels] belongs to other labels or lines; if
    possible, the label's line crosses none of ``lines``.
    """
    at, label = canvas.place(places), no_label()
    if words and canvas.shows(places[:1])[0]:
        others = at if taken is None else np.concatenate([at, taken])
        label = joined_label(canvas, at[0], words, others, colour, lines)
    recording.log(list(entity), *label, static=static)


def _has_line(mark: Point, edge: Point) -> bool:
    """Return whether a line joins a mark to the nearest edge of its label."""
    return bool(np.linalg.norm(edge - mark) > MARKS.leader)


def _frame_places(canvas: Canvas, half: Point) -> Points:
    """Return places of a label of half a size within the frame."""
    low, high = _frame_corners(canvas, half)
    return places_between(low, high, MARKS.label_grid) if (low <= high).all() else np.zeros((0, 2))


def _frame_corners(canvas: Canvas, half: Point) -> tuple[Point, Point]:
    """Return the corners of all places of a label of half a size, within the frame and outside it."""
    inset = half + MARKS.frame_gap
    return canvas.origin + inset, canvas.origin + np.array([canvas.width, canvas.height]) - inset


def _is_inside(canvas: Canvas, middles: Points, half: Point) -> Mask:
    """Return at which places a label of half a size is within the frame."""
    low, high = _frame_corners(canvas, half)
    return np.asarray(((middles >= low - 1e-9) & (middles <= high + 1e-9)).all(axis=1))


def _title_area(canvas: Canvas) -> Points:
    """Return points on the vertical axis label."""
    return label_area(canvas.upper_label_middle, canvas.labels[1]) if canvas.ticked[1] else np.zeros((0, 2))


def _margin_places(canvas: Canvas, half: Point) -> Points:
    """Return places of a label above the frame, next to the vertical axis label, or right of the frame."""
    (x, y), right = canvas.origin, canvas.origin[0] + canvas.width
    title_end = canvas.upper_label_middle[0] + half_size(canvas.labels[1])[0]
    begin = max(x, title_end + MARKS.title_gap) if canvas.ticked[1] else x
    places = [np.zeros((0, 2))]
    if 2 * half[1] <= TEXT.top and begin + 2 * half[0] <= right + canvas.side_room:
        above = y - TEXT.rise
        places.append(
            places_between(np.array([begin + half[0], above]), np.array([right - half[0], above]), MARKS.label_grid)
        )
    if 2 * half[0] + 8.0 <= canvas.side_room:
        low = np.array([right + 8.0 + half[0], y + half[1]])
        places.append(places_between(low, np.array([low[0], y + canvas.height - half[1]]), MARKS.label_grid))
    return np.concatenate(places)

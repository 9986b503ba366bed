"""Places of labels that cover as few other marks as possible, and lines from labels to marks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import rerun as rr
from jaxtyping import Float

from paretoik.review.drawing.axes import TEXT, Canvas, flat_lines, labels
from paretoik.review.outlines import NO_LINES, Lines, Point, freest_place, places_beside, places_between
from paretoik.review.palette import MARKS, Colour

# The sizes of labels as the viewer draws them: words on a plate, in letters of different widths.


@dataclass(frozen=True, kw_only=True)
class LabelOptions:
    """Sizes of labels [pixels], measured in pictures of the viewer."""

    height: float = 12.5  # height of the viewer's font, Inter
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
    padding: tuple[float, float] = (11.0, 8.0)  # size of the plate minus size of the words, across and upwards
    reserve: float = 1.06  # factor of a label's size, because smaller windows draw the frame smaller, but not labels


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


def label_place(
    canvas: Canvas, mark: Point, words: str, others: Points, lines: Lines = NO_LINES, *, is_joined: bool = True
) -> Point:
    """Return the middle of a `mark`'s label [pixels].

    It is the nearest place that covers the fewest points of ``others`` [pixels], within the frame if there is space.
    If ``is_joined`` and no place next to the mark is free, it is farther away, in the frame or in a margin, with a line
    to the mark. If possible, this line crosses none of ``lines`` and touches no other mark.
    """
    half = half_size(words)
    if canvas.ticked[1]:
        others = np.concatenate([others, label_area(canvas.upper_label_middle, canvas.labels[1])])
    corner, size = canvas.origin, np.array([canvas.width, canvas.height])
    low, high = corner + half + MARKS.frame_gap, corner + size - half - MARKS.frame_gap
    height = 2.0 * float(half[1]) + MARKS.label_gap
    beside = places_beside(mark, half, tuple(MARKS.clearance + (step - 1.0) * height for step in MARKS.label_steps))
    near = beside[((beside >= low - 1e-9) & (beside <= high + 1e-9)).all(axis=1)]
    settings = mark, others, MARKS.label_gap, lines, MARKS.end, MARKS.leader
    best, is_free = freest_place(near if len(near) else beside, half, *settings)
    if (len(near) and is_free) or not is_joined:
        return best
    places = [near, places_between(low, high, MARKS.label_grid) if (low <= high).all() else near[:0]]
    # margins: above the frame, next to the vertical axis label, and right of the frame
    right, begin = corner[0] + canvas.width, corner[0]
    if canvas.ticked[1]:
        begin = max(begin, canvas.upper_label_middle[0] + half_size(canvas.labels[1])[0] + MARKS.title_gap)
    if 2 * half[1] <= TEXT.top and begin + 2 * half[0] <= right + canvas.side_room:
        first, last = np.array([[begin + half[0], corner[1] - TEXT.rise], [right - half[0], corner[1] - TEXT.rise]])
        places.append(places_between(first, last, MARKS.label_grid))
    if 2 * half[0] + 8.0 <= canvas.side_room:
        x, bottom = right + 8.0 + half[0], corner[1] + canvas.height - half[1]
        places.append(places_between(np.array([x, corner[1] + half[1]]), np.array([x, bottom]), MARKS.label_grid))
    middles = np.concatenate(places)
    return freest_place(middles, half, *settings)[0] if len(middles) else best


def label_area(middle: Point, words: str) -> Points:
    """Return points on a label around its `middle`."""
    grid = np.stack(np.meshgrid(np.linspace(-1.0, 1.0, 9), np.linspace(-1.0, 1.0, 3)), axis=-1).reshape(-1, 2)
    return np.asarray(middle + plate_half(words) * grid)


def label_lines(mark: Point, middle: Point, words: str) -> Lines:
    """Return the line from a `mark` to its label, and the label's diagonals, which other lines must not cross."""
    half = half_size(words)
    across = half * [1.0, -1.0]
    return np.array([[mark, middle], [middle - half, middle + half], [middle - across, middle + across]])


def joined_labels(
    marks: Points | Sequence[Point], middles: Sequence[Point], words: Sequence[str], colour: Colour
) -> tuple[rr.Points2D, rr.LineStrips2D]:
    """Return the labels of ``marks`` around their ``middles``, and lines to distant labels."""
    joins, places = list[Points](), [np.zeros((0, 2))]
    for mark, middle, each in zip(marks, middles, words, strict=True):
        half, within = half_size(each), plate_half(each) - MARKS.overlap
        if np.linalg.norm(np.clip(mark, middle - half, middle + half) - mark) > MARKS.leader:
            joins.append(np.stack([mark, np.clip(mark, middle - within, middle + within)]))
        below = 0.5 * LABEL.line * each.count("\n")  # the middle of words is below that of their first line
        places.append((middle - (0.0, below))[None])
    return labels(words, np.concatenate(places), colour), flat_lines(joins, colour, 0.6, 3.8)


def line_points(lines: Iterable[Float[np.ndarray, "2 2"]]) -> Points:
    """Return points along lines [pixels], so close that no label fits between two of them."""
    shares = np.linspace(0.0, 1.0, MARKS.line_points)[:, None]
    return np.concatenate([np.zeros((0, 2)), *(start + shares * (end - start) for start, end in lines)])

"""The panels of pairs of objectives: one view with a scatter per pair, ticks only at its outer edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Objectives, Values
from paretoik.review.drawing.axes import TEXT, Canvas, axis_ranges, labels, screen_text, text_width, window
from paretoik.review.drawing.labels import half_size, label_area, line_points, log_name
from paretoik.review.outlines import count_covered
from paretoik.review.palette import DRAWING, MARKS, SCREEN, VIEWS, Colour
from paretoik.review.recording.messages import RecordedPoint
from paretoik.review.recording.recorder import Population

# The layers of points that a panel of two objectives shows, each with its colour and size.


Layer = Literal["population", "final", "front", "chosen", "looked_at", "choice", "compared", "predicted"]
LAYERS: dict[Layer, tuple[Colour, float, float]] = {  # colour, radius, drawing order
    "population": (SCREEN.population, 2.2, 1.0),
    "final": (SCREEN.final, 2.6, 0.5),
    "front": (SCREEN.front, 3.2, 2.0),
    "chosen": (SCREEN.chosen, 6.5, 4.0),
    "looked_at": (SCREEN.arm, 4.0, 4.5),  # as its arm; smaller, so that a best or chosen point below it stays visible
    "choice": (SCREEN.chosen, 6.5, 4.0),
    "compared": (SCREEN.compared, 6.5, 3.5),
    "predicted": (SCREEN.predicted, 5.5, 2.9),
}


# The best points of the objectives in a panel of two of them.


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
    """Mark the best points of the objectives ``names`` at their ``places`` (points, 2), at the current time.

    If several coincide, or one coincides with the chosen one, each mark is a ring around the next. A point that is best
    in several objectives has their names next to it, off ``others`` (points, 2) and what is ``taken`` [pixels]; without
    ``others`` no names are drawn. ``of`` says whose ids the points have.
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
    for number in range(max(1, len(names) // 2)):  # the largest possible number of labels
        words, rows = next(iter(list(shared)[number:]), ""), list(shared.values())[number : number + 1]
        everything = np.concatenate([places[rows], others, places])
        log_name(recording, [*entity, "ends", f"names_{number}"], canvas, words, everything, SCREEN.text, taken=taken)


def ring_radii(
    at: Float[np.ndarray, "points 2"], marks: Sequence[int], chosen: Sequence[int]
) -> Float[np.ndarray, " marks"]:
    """Return the radii of marks [pixels] at their places; each mark on top adds a ring."""
    apart = np.linalg.norm(at[list(marks), None] - at[[*marks, *chosen]], axis=2)
    on_top = np.triu(apart < MARKS.end, k=1).sum(axis=1)  # a later mark is drawn above, the chosen point above all
    return np.asarray(MARKS.end + MARKS.ring * on_top, dtype=float)


def best_words(points: Sequence[RecordedPoint], row: int, names: Sequence[str]) -> str:
    """Return the objectives in which a row's point is best, one per line."""
    same = [point.axis for point in points if point.axis is not None and point.id == points[row].id]
    return "\n".join(f"best {screen_text(names[axis])}" for axis in same)


# Panels of pairs of objectives.


Pair = tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class Panels:
    """The panels of objectives with ``labels``: each pair (horizontal, vertical) and its cell in a grid."""

    labels: tuple[str, ...]

    @property
    def pairs(self) -> list[Pair]:
        """All pairs for up to five objectives, only neighbours for more; none for one objective."""
        n_obj = len(self.labels)
        return list(combinations(range(n_obj), 2) if n_obj <= DRAWING.matrix else pairwise(range(n_obj)))

    def canvases(self, shown: Objectives) -> list[Canvas]:
        """Return one canvas per pair, scaled to show `shown`; none if it has no finite point."""
        shown = shown[np.isfinite(shown).all(axis=1)]
        if len(shown) == 0 or not self.pairs:
            return []
        corners = [window(shown[:, list(pair)]) for pair in self.pairs]
        return [self._canvas(number, low, high) for number, (low, high) in enumerate(corners)]

    def bounds(self) -> rrb.VisualBounds2D:
        """Return the bounds of the view that contains all panels."""
        canvases = [self._canvas(number, np.zeros(2), np.ones(2)) for number in range(len(self.pairs))]
        right = max(canvas.origin[0] + canvas.width for canvas in canvases) + TEXT.right
        bottom = max(canvas.origin[1] + canvas.height for canvas in canvases) + TEXT.bottom + self._stagger
        return rrb.VisualBounds2D(x_range=[-TEXT.left, right], y_range=[-TEXT.top, bottom])

    def _canvas(self, number: int, low: Values, high: Values) -> Canvas:
        first, second = self.pairs[number]
        matrix = len(self.labels) <= DRAWING.matrix
        count = len(self.labels) - 1
        columns = count if matrix else int(np.ceil(np.sqrt(count)))
        rows = count if matrix else int(np.ceil(count / columns))
        column, row = (first, second - 1) if matrix else (number % columns, number // columns)
        across, below = (12.0, 2.0 * TEXT.line) if matrix else (TEXT.left + 10.0, TEXT.top + TEXT.bottom)
        width = (VIEWS.panels[0] - TEXT.left - TEXT.right - (columns - 1) * across) / columns
        height = (VIEWS.panels[1] - TEXT.top - TEXT.bottom - self._stagger - (rows - 1) * below) / rows
        down = self._stagger * (column % 2) if matrix else 0.0
        return Canvas(
            low=low,
            high=high,
            labels=(self.labels[first], self.labels[second]),
            width=width,
            height=height,
            origin=np.array([column * (width + across), row * (height + below)]),
            ticked=(row == rows - 1, column == 0) if matrix else (True, True),
            label_drop=down,
            overhang=0.45 * across if columns > 1 else TEXT.right,
            right_edge=VIEWS.panels[0] - TEXT.left,
            side_room=(columns - 1 - column) * (width + across) if matrix and column == row else 0.0,
        )

    @property
    def _stagger(self) -> float:
        """How far every second label below is moved down if neighbours would overlap."""
        count = len(self.labels) - 1
        if not 1 < count < DRAWING.matrix:
            return 0.0
        room = VIEWS.panels[0] / count
        return TEXT.line if TEXT.character * max(map(len, self.labels)) > room - 10.0 else 0.0


def normalised(F: Objectives, reference: Population) -> Objectives:
    """Return points as shares of the ranges of a front.

    If a front has only one value in an objective, its points are in the middle and other points are infinitely far.
    """
    low, width = reference.min(axis=0), np.ptp(reference, axis=0)
    without_range = np.where(low == F, 0.5, np.copysign(np.inf, F - low))
    normalised: Objectives = np.where(width > 0, (F - low) / np.where(width > 0, width, 1.0), without_range)
    return normalised


def replay_window(fronts: Sequence[Float[np.ndarray, "_ n_obj"]]) -> Objectives:
    """Return corners (2, n_obj) around the last of `fronts` and, if they are near, the earlier ones.

    An early front may be far away; the window reaches at most 1.5 final ranges beyond the final front.
    """
    everything, front = np.concatenate(fronts), fronts[-1]
    low, high = front.min(axis=0), front.max(axis=0)
    reach = 1.5 * axis_ranges(low, high)
    return np.stack([np.maximum(everything.min(axis=0), low - reach), np.minimum(everything.max(axis=0), high + reach)])


# The lines in a panel of two objectives: bounds ε of a sweep, and moves of refined points.


@dataclass(frozen=True, kw_only=True, eq=False)
class Bound:
    """A bound ε as a line across a panel, and the words at its end, all [pixels]."""

    ends: Float[np.ndarray, "2 2"]
    words: str
    middle: Float[np.ndarray, " 2"]


def bounds_in(
    canvas: Canvas,
    epsilon: Values | None,
    labelled: tuple[tuple[str, str], tuple[str, str]],
    maximised: tuple[bool, bool],
) -> list[Bound]:
    """Return the finite bounds of the two objectives of a panel that it shows; none if ``epsilon`` is None.

    ``labelled`` are names and units. The words of a bound are next to its line and avoid the other line and its words.
    """
    lines, words = list[np.ndarray](), list[str]()
    for axis in range(2) if epsilon is not None else ():
        assert epsilon is not None
        bound = epsilon[axis]
        if not (np.isfinite(bound) and canvas.low[axis] <= bound <= canvas.high[axis]):
            continue
        line = np.stack([canvas.low, canvas.high])
        line[:, axis] = bound
        (name, unit), sense = labelled[axis], "≥" if maximised[axis] else "≤"
        lines.append(canvas.place(line))
        words.append(f"ε: {name} {sense} {bound:.4g} {unit}".rstrip())
    bounds = list[Bound]()
    for number, ends in reversed(list(enumerate(lines))):  # words next to a vertical line have more places
        others = [line_points(other[None]) for other in lines[:number] + lines[number + 1 :]]
        areas = [label_area(bound.middle, bound.words) for bound in bounds]
        taken = np.concatenate([np.zeros((0, 2)), *others, *areas])
        bounds.append(
            Bound(ends=ends, words=words[number], middle=_end_label_place(canvas, ends, words[number], taken))
        )
    return bounds[::-1]


def log_bounds(recording: rr.RecordingStream, entity: Sequence[str], bounds: Sequence[Bound]) -> None:
    """Draw the bounds of a panel at the current time, with their words."""
    ends, words = [bound.ends for bound in bounds], [bound.words for bound in bounds]
    lines = rr.LineStrips2D(ends, colors=SCREEN.epsilon, radii=rr.Radius.ui_points(1.0), draw_order=0.5)
    recording.log(list(entity), lines)
    middles = np.array([bound.middle for bound in bounds]).reshape(-1, 2)
    recording.log([*entity, "names"], labels(words, middles, SCREEN.epsilon))


def bound_points(bounds: Sequence[Bound]) -> Float[np.ndarray, "points 2"]:
    """Return points along bounds and on their words [pixels], which other labels must avoid."""
    areas = [label_area(bound.middle, bound.words) for bound in bounds]
    return np.concatenate([line_points(np.array([bound.ends for bound in bounds]).reshape(-1, 2, 2)), *areas])


def _end_label_place(
    canvas: Canvas, ends: Float[np.ndarray, "2 2"], words: str, others: Float[np.ndarray, "marks 2"]
) -> Float[np.ndarray, " 2"]:
    """Return the middle of the words of a line in a panel that cover the fewest of ``others``, within the frame.

    Among these, take the one nearest the end of the line, on the side with more space; on the line if neither side has
    enough.
    """
    half = np.array([0.5 * text_width(words) + 8.0, half_size(words)[1]])
    offset, middle = half + np.array([6.0, 4.0]), canvas.origin + 0.5 * np.array([canvas.width, canvas.height])
    inwards = np.where(ends[-1] > middle, -1.0, 1.0)
    across = np.abs(ends[1] - ends[0]) < 1e-9  # the axis across the line
    last, first = ends[-1] + inwards * offset, ends[0] + np.where(across, inwards, -inwards) * offset
    places = last + np.linspace(0.0, 1.0, MARKS.label_grid)[:, None] * (first - last)
    middles = np.stack([places, places - 2.0 * across * inwards * offset], axis=1).reshape(-1, 2)
    inset = half + MARKS.frame_gap
    low, high = canvas.origin + inset, canvas.origin + np.array([canvas.width, canvas.height]) - inset
    middles = np.concatenate([middles, np.minimum(np.maximum(middles, low), high)])
    outside = ((middles < low - 1e-6) | (middles > high + 1e-6)).any(axis=1)
    return np.asarray(middles[(count_covered(middles, half, others) + MARKS.outside * outside).argmin()])


def log_moves(recording: rr.RecordingStream, entity: Sequence[str], moves: Float[np.ndarray, "moves 2 2"]) -> None:
    """Draw arrows along the moves of a panel, at the current time."""
    arrows = rr.Arrows2D(
        origins=moves[:, 0],
        vectors=moves[:, 1] - moves[:, 0],
        colors=SCREEN.moves,
        radii=rr.Radius.ui_points(0.8),
        draw_order=1.5,
    )
    recording.log(list(entity), arrows)

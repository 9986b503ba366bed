"""What lines a panel of two objectives shows: bounds ε of a sweep, and where refined points came from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
from jaxtyping import Float

from paretoik.arrays import Objectives, Values
from paretoik.formulations.protocol import Timeline
from paretoik.review.drawing.drawn_axes import Canvas, labels, text_width
from paretoik.review.drawing.front_panels import Pair
from paretoik.review.drawing.label_places import label_area, line_points
from paretoik.review.drawing.label_sizes import half_size
from paretoik.review.drawing.screen_text import screen_text
from paretoik.review.drawing_options import MARKS
from paretoik.review.label_candidates import count_covered
from paretoik.review.palette import SCREEN
from paretoik.review.recording.recorder import Generation


@dataclass(frozen=True, kw_only=True)
class PanelLines:
    """The lines of generations of a ``timeline``: levels have bounds, refinements moves, others none.

    Names and units are those of the objectives, ``maximised`` says which are.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    maximised: tuple[bool, ...]
    timeline: Timeline

    def log(
        self, recording: rr.RecordingStream, entity: Sequence[str], canvas: Canvas, pair: Pair, generation: Generation
    ) -> None:
        """Draw the lines of a generation in the panel of a pair of objectives, at the current time."""
        if self.timeline == "refinement":
            log_moves(recording, [*entity, "moves"], self._moves(canvas, pair, generation))
        elif self.timeline == "level":
            log_bounds(recording, [*entity, "epsilon"], self._bounds(canvas, pair, generation))

    def points(self, canvas: Canvas, pair: Pair, generation: Generation) -> Float[np.ndarray, "points 2"]:
        """Return points [pixels] all over those lines and what is said of them, for labels to keep off them."""
        if self.timeline == "refinement":
            return line_points(self._moves(canvas, pair, generation))
        return bound_points(self._bounds(canvas, pair, generation)) if self.timeline == "level" else np.zeros((0, 2))

    def _moves(self, canvas: Canvas, pair: Pair, generation: Generation) -> Float[np.ndarray, "moves 2 2"]:
        columns = list(pair)
        origins = None if generation.origins is None else generation.origins[:, columns]
        return moves_in(canvas, origins, generation.front[:, columns])

    def _bounds(self, canvas: Canvas, pair: Pair, generation: Generation) -> list[Bound]:
        epsilon = None if generation.epsilon is None else generation.epsilon[list(pair)]
        first, second = ((screen_text(self.names[axis]), self.units[axis]) for axis in pair)
        return bounds_in(canvas, epsilon, (first, second), (self.maximised[pair[0]], self.maximised[pair[1]]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Bound:
    """A bound ε as a line across a panel, and what is said beside its end, all [pixels]."""

    ends: Float[np.ndarray, "2 2"]
    words: str
    middle: Float[np.ndarray, " 2"]


def bounds_in(
    canvas: Canvas,
    epsilon: Values | None,
    labelled: tuple[tuple[str, str], tuple[str, str]],
    maximised: tuple[bool, bool],
) -> list[Bound]:
    """Return the finite bounds of the two objectives of a panel that it shows; none where ``epsilon`` is None.

    ``labelled`` are names and units. What a bound is stands beside its line, off the other line and what that is.
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
    for number, ends in reversed(list(enumerate(lines))):  # words beside an upright line have more places
        others = [line_points(other[None]) for other in lines[:number] + lines[number + 1 :]]
        areas = [label_area(bound.middle, bound.words) for bound in bounds]
        taken = np.concatenate([np.zeros((0, 2)), *others, *areas])
        bounds.append(
            Bound(ends=ends, words=words[number], middle=_end_label_place(canvas, ends, words[number], taken))
        )
    return bounds[::-1]


def log_bounds(recording: rr.RecordingStream, entity: Sequence[str], bounds: Sequence[Bound]) -> None:
    """Draw the bounds of a panel at the current time, with what they are."""
    ends, words = [bound.ends for bound in bounds], [bound.words for bound in bounds]
    lines = rr.LineStrips2D(ends, colors=SCREEN.epsilon, radii=rr.Radius.ui_points(1.0), draw_order=0.5)
    recording.log(list(entity), lines)
    middles = np.array([bound.middle for bound in bounds]).reshape(-1, 2)
    recording.log([*entity, "names"], labels(words, middles, SCREEN.epsilon))


def bound_points(bounds: Sequence[Bound]) -> Float[np.ndarray, "points 2"]:
    """Return points along bounds and all over what is said of them [pixels]: other labels are to keep off them."""
    areas = [label_area(bound.middle, bound.words) for bound in bounds]
    return np.concatenate([line_points(np.array([bound.ends for bound in bounds]).reshape(-1, 2, 2)), *areas])


def _end_label_place(
    canvas: Canvas, ends: Float[np.ndarray, "2 2"], words: str, others: Float[np.ndarray, "marks 2"]
) -> Float[np.ndarray, " 2"]:
    """Return the middle of words beside a line across a panel that covers fewest of ``others``, within the frame.

    Of such that nearest to where the line ends, on the side that has more room; on the line where neither has enough.
    """
    half = np.array([0.5 * text_width(words) + 8.0, half_size(words)[1]])
    offset, middle = half + np.array([6.0, 4.0]), canvas.origin + 0.5 * np.array([canvas.width, canvas.height])
    inwards = np.where(ends[-1] > middle, -1.0, 1.0)
    across = np.abs(ends[1] - ends[0]) < 1e-9  # the axis along which a line has two sides
    last, first = ends[-1] + inwards * offset, ends[0] + np.where(across, inwards, -inwards) * offset
    places = last + np.linspace(0.0, 1.0, MARKS.label_grid)[:, None] * (first - last)
    middles = np.stack([places, places - 2.0 * across * inwards * offset], axis=1).reshape(-1, 2)
    inset = half + MARKS.frame_gap
    low, high = canvas.origin + inset, canvas.origin + np.array([canvas.width, canvas.height]) - inset
    middles = np.concatenate([middles, np.minimum(np.maximum(middles, low), high)])
    outside = ((middles < low - 1e-6) | (middles > high + 1e-6)).any(axis=1)
    return np.asarray(middles[(count_covered(middles, half, others) + MARKS.outside * outside).argmin()])


def moves_in(canvas: Canvas, origins: Objectives | None, front: Objectives) -> Float[np.ndarray, "moves 2 2"]:
    """Return from where each point (points, 2) was to where it is, as lines [pixels]; none without origins."""
    origins = front[:0] if origins is None else origins
    seen = canvas.shows(origins) & canvas.shows(front[: len(origins)])
    return np.stack([canvas.place(origins[seen]), canvas.place(front[: len(origins)][seen])], axis=1)


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

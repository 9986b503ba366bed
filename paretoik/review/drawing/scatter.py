"""The drawing of a front: one view with a panel per pair of objectives, ticks at its outer edges, names of points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Ids, Mask, Objectives
from paretoik.review.drawing.axes import (
    TEXT,
    Canvas,
    axis_ranges,
    entity_names,
    flat_dots,
    flat_lines,
    flat_view,
    labels,
    screen_text,
    window,
)
from paretoik.review.drawing.label_places import joined_labels, label_area, label_lines, label_place, line_points
from paretoik.review.outlines import NO_LINES, Lines
from paretoik.review.palette import DRAWING, MARKS, SCREEN, VIEWS, Colour
from paretoik.review.recording.messages import RecordedPoint
from paretoik.review.recording.recorder import Generation, Population, SearchedFront

NO_POINTS = np.zeros((0, 2))
Area = Float[np.ndarray, "area 2"]  # points [pixels] that labels avoid
Bound = tuple[Float[np.ndarray, "2 2"], str, Float[np.ndarray, " 2"]]  # a line, its words and their middle [pixels]
Points = Float[np.ndarray, "_ n_obj"]  # any number of points
Pair = tuple[int, int]
Layer = Literal["population", "final", "front", "chosen", "looked_at", "choice", "compared", "predicted"]
LAYERS: dict[Layer, tuple[Colour, float, float]] = {  # colour, radius, drawing order
    "population": (SCREEN.population, 2.2, 1.0),
    "final": (SCREEN.final, 2.6, 0.5),
    "front": (SCREEN.front, 3.2, 2.0),
    "chosen": (SCREEN.chosen, 6.5, 4.0),
    "looked_at": (SCREEN.arm, 4.0, 4.5),  # colour of its arm; small, so that a best or chosen point below it is visible
    "choice": (SCREEN.chosen, 6.5, 4.0),
    "compared": (SCREEN.compared, 6.5, 3.5),
    "predicted": (SCREEN.predicted, 5.5, 2.9),
}


def matrix(names: Sequence[str], shown: Objectives) -> list[tuple[Pair, Canvas]]:
    """Return pairs of objectives (horizontal, vertical), each with a canvas that contains all finite points.

    Up to five objectives have a panel for every pair, more have one per pair of neighbours, one has none.
    """
    shown, count, whole = shown[np.isfinite(shown).all(axis=1)], len(names) - 1, len(names) <= DRAWING.matrix
    if not len(shown) or not count:
        return []
    columns = count if whole else int(np.ceil(np.sqrt(count)))
    rows = count if whole else int(np.ceil(count / columns))
    across, below = (12.0, 2.0 * TEXT.line) if whole else (TEXT.left + 10.0, TEXT.top + TEXT.bottom)
    is_tight = TEXT.character * max(map(len, names)) > VIEWS.panels[0] / count - 10.0
    stagger = TEXT.line if is_tight and 1 < count < DRAWING.matrix else 0.0  # shift of every second lower label
    width = (VIEWS.panels[0] - TEXT.left - TEXT.right - (columns - 1) * across) / columns
    height = (VIEWS.panels[1] - TEXT.top - TEXT.bottom - stagger - (rows - 1) * below) / rows
    panels = []
    pairs = combinations(range(len(names)), 2) if whole else pairwise(range(len(names)))
    for number, (first, second) in enumerate(pairs):
        column, row = (first, second - 1) if whole else (number % columns, number // columns)
        low, high = window(shown[:, [first, second]])
        canvas = Canvas(
            low=low,
            high=high,
            labels=(names[first], names[second]),
            width=width,
            height=height,
            origin=np.array([column * (width + across), row * (height + below)]),
            ticked=(row == rows - 1, column == 0) if whole else (True, True),
            label_drop=stagger * (column % 2) if whole else 0.0,
            overhang=0.45 * across if columns > 1 else TEXT.right,
            right_edge=VIEWS.panels[0] - TEXT.left,
            side_room=(columns - 1 - column) * (width + across) if whole and column == row else 0.0,
        )
        panels.append(((first, second), canvas))
    return panels


class Panel(NamedTuple):
    """The panel of a pair of objectives at an entity."""

    pair: Pair
    entity: list[str]
    canvas: Canvas

    def place(self, F: Population) -> Area:
        """Return the positions [pixels] of points."""
        return self.canvas.place(F[:, list(self.pair)])

    def shows(self, F: Population) -> Mask:
        """Return which points are in the window."""
        return self.canvas.shows(F[:, list(self.pair)])


def normalised(F: Objectives, reference: Population) -> Objectives:
    """Return points as shares of the ranges of a front.

    If all points of the front have the same value, they are in the middle and other points are infinitely far.
    """
    low, width = reference.min(axis=0), np.ptp(reference, axis=0)
    without_range = np.where(low == F, 0.5, np.copysign(np.inf, F - low))
    normalised: Objectives = np.where(width > 0, (F - low) / np.where(width > 0, width, 1.0), without_range)
    return normalised


def replay_window(fronts: Sequence[Points]) -> Objectives:
    """Return corners (2, n_obj) of a window around the last of `fronts` and near parts of earlier ones.

    Early fronts may be far away, so the window reaches at most 1.5 final ranges beyond the last front.
    """
    everything, front = np.concatenate(fronts), fronts[-1]
    low, high = front.min(axis=0), front.max(axis=0)
    reach = 1.5 * axis_ranges(low, high)
    return np.stack([np.maximum(everything.min(axis=0), low - reach), np.minimum(everything.max(axis=0), high + reach)])


@dataclass(frozen=True, kw_only=True, eq=False)
class Scatter:
    """The fronts of a ``scene`` on axes that contain all of ``shown``, below the entity ``root``.

    Only the first panel has names of points. They avoid an ``Area``.
    """

    scene: SearchedFront
    shown: Objectives
    root: tuple[str, ...] = ()

    @cached_property
    def panels(self) -> list[Panel]:
        """The panels; none without a finite point."""
        scene, is_step = self.scene, self.scene.timeline == "step"
        words = [f"{name}, share of its range" if is_step else scene.label(k) for k, name in enumerate(scene.names)]
        shown, names = self.shown[np.isfinite(self.shown).all(axis=1)], entity_names(scene.names)
        if is_step and len(shown):  # drawn as shares of ranges
            shown = np.array([[0.0], [1.0]]) * np.ones(len(names))
        return [
            Panel(pair, [*self.root, "front", f"{names[pair[0]]} - {names[pair[1]]}"], canvas)
            for pair, canvas in matrix(list(map(screen_text, words)), shown)
        ]

    def area(self, *values: Points) -> Area:
        """Return the positions of points in the first panel."""
        return self.panels[0].place(np.concatenate(values)) if self.panels else NO_POINTS

    def outside(self, F: Objectives) -> int:
        """Return how many points at least one panel does not show; 0 without panels."""
        return int((~np.all([panel.shows(F) for panel in self.panels], axis=0)).sum()) if self.panels else 0

    def view(self) -> rrb.View | None:
        """Return the view of all pairs; None if nothing finite is shown."""
        if not self.panels:
            return None
        canvases = [panel.canvas for panel in self.panels]
        right = max(canvas.origin[0] + canvas.width for canvas in canvases) + TEXT.right
        bottom = max(canvas.origin[1] + canvas.height for canvas in canvases) + TEXT.bottom
        bottom += max(canvas.label_drop for canvas in canvases)
        bounds = rrb.VisualBounds2D(x_range=[-TEXT.left, right], y_range=[-TEXT.top, bottom])
        name = "front" if self.scene.timeline != "step" else "front, as shares of its ranges"
        return flat_view(rr.new_entity_path([*self.root, "front"]), name, bounds)

    def log_axes(self, recording: rr.RecordingStream) -> None:
        """Draw all axes, for all times."""
        for _, entity, canvas in self.panels:
            canvas.log(recording, rr.new_entity_path(entity))

    def log_generation(
        self, recording: rr.RecordingStream, generation: Generation, *, behind: Sequence[Points] = ()
    ) -> None:
        """Draw a generation at the current time, and record its exact numbers; labels also avoid points ``behind``."""
        timeline, front, population = self.scene.timeline, generation.front, generation.population
        reference = front if timeline == "step" else None
        self.log_points(recording, "population", population, reference=reference)
        self.log_points(recording, "front", front, ids=generation.front_ids, reference=reference)
        for panel in self.panels:
            if timeline == "refinement":
                moves = self._moves(panel, generation)
                style: Any = {"colors": SCREEN.moves, "radii": rr.Radius.ui_points(0.8), "draw_order": 1.5}
                arrows = rr.Arrows2D(origins=moves[:, 0], vectors=moves[:, 1] - moves[:, 0], **style)
                recording.log([*panel.entity, "moves"], arrows)
            elif timeline == "level":
                bounds = self._bounds(panel, generation)
                middles = np.concatenate([NO_POINTS, *(middle[None] for _, _, middle in bounds)])
                lines = flat_lines([line for line, _, _ in bounds], SCREEN.epsilon, 1.0, 0.5)
                recording.log([*panel.entity, "epsilon"], lines)
                names = labels([words for _, words, _ in bounds], middles, SCREEN.epsilon)
                recording.log([*panel.entity, "epsilon", "names"], names)
        if generation.chosen is not None:
            self.log_points(recording, "chosen", generation.chosen[None], reference=reference)
            self.log_label(recording, "chosen", generation.chosen[None], "")
        of = f" of level {generation.number}" if timeline == "level" else ""  # the final front renumbers
        avoid = np.concatenate([self.area(front, population, *behind), self.lines(generation)])
        self.log_marked(recording, generation.points, of=of, avoid=avoid)

    def log_note(self, recording: rr.RecordingStream, words: str) -> None:
        """Write a note into every panel at the current time; without words, remove it."""
        for _, entity, canvas in self.panels:
            middle = canvas.origin + 0.5 * np.array([canvas.width, canvas.height])
            recording.log([*entity, "note"], labels([words], middle[None]) if words else rr.Points2D([]))

    def lines(self, generation: Generation) -> Area:
        """Return points [pixels] on a generation's lines and their labels."""
        for panel in self.panels[:1]:
            if self.scene.timeline == "refinement":
                return line_points(self._moves(panel, generation))
            if self.scene.timeline == "level":
                bounds = self._bounds(panel, generation)
                areas = [label_area(middle, words) for _, words, middle in bounds]
                return np.concatenate([line_points([line for line, _, _ in bounds]), *areas])
        return NO_POINTS

    def log_points(
        self,
        recording: rr.RecordingStream,
        layer: Layer,
        F: Objectives,
        *,
        ids: Ids | None = None,
        names: Sequence[str] | None = None,
        reference: Population | None = None,
        static: bool = False,
    ) -> None:
        """Draw points as a layer of every panel, as shares of the ranges of a ``reference`` front, if any.

        Points outside a window are not drawn, but their values are recorded. ``names`` appear under the mouse.
        """
        drawn = F if reference is None else normalised(F, reference)
        for panel in self.panels:
            seen = panel.shows(drawn)
            words = None if names is None else [names[row] for row in np.flatnonzero(seen).tolist()]
            points = flat_dots(panel.place(drawn[seen]), *LAYERS[layer], labels=words, show_labels=False)
            recording.log([*panel.entity, layer], points, static=static)
        if layer != "final":
            numbers: dict[str, Any] = {} if ids is None else {"ids": ids}
            values = rr.AnyValues(F=F.ravel(), n_obj=F.shape[1], **numbers)
            recording.log([*self.root, "search", layer], values, static=static)

    def log_label(
        self,
        recording: rr.RecordingStream,
        layer: Layer,
        F: Objectives,
        words: str,
        *,
        avoid: Area = NO_POINTS,
        lines: Lines = NO_LINES,
        static: bool = False,
    ) -> None:
        """Label a layer's point F (1, n_obj); if ``words`` is empty, remove the label."""
        for panel in self.panels[:1]:
            marks = panel.place(F[panel.shows(F)]) if words else NO_POINTS
            others = np.concatenate([panel.place(F), avoid])
            middles = [label_place(panel.canvas, mark, words, others, lines) for mark in marks]
            label = joined_labels(marks, middles, [words] * len(marks), LAYERS[layer][0])
            recording.log([*panel.entity, layer, "name"], *label, static=static)

    def log_marked(
        self, recording: rr.RecordingStream, points: Sequence[RecordedPoint], *, of: str = "", avoid: Area
    ) -> None:
        """Draw the best points of the objectives in their colours, and the chosen one.

        If several of these coincide, each mark is a ring around the next.
        ``of``: words after their ids, such as " of level 3".
        """
        ends = [row for row, point in enumerate(points) if point.axis is not None]
        chosen = [row for row, point in enumerate(points) if point.axis is None]
        words = [self._best_words(points, point) for point in points]
        for panel in self.panels if ends else ():
            places = np.array([point.objectives for point in points])
            at, seen = panel.place(places), panel.shows(places)
            marks = [row for row in ends if seen[row]]
            near = np.linalg.norm(at[marks, None] - at[[*marks, *chosen]], axis=2) < MARKS.end
            # later marks are drawn above earlier ones, the chosen point above all
            radii = MARKS.end + MARKS.ring * np.triu(near, k=1).sum(axis=1)
            said = [f"point {points[row].id}{of}, {', '.join(words[row].splitlines())}" for row in marks]
            colours = [SCREEN.end(points[row].axis or 0) for row in marks]
            markers = flat_dots(at[marks], colours, radii, 3.0, labels=said, show_labels=False)
            recording.log([*panel.entity, "ends"], markers)
            if panel is self.panels[0]:  # names of points that are best in several objectives
                shared = {words[row]: row for row in marks if "\n" in words[row]}
                own = {points[row].id for row in chosen}
                named = [row for row in shared.values() if points[row].id not in own]
                others = np.concatenate([at, avoid])
                middles = [label_place(panel.canvas, at[row], words[row], others) for row in named]
                label = joined_labels(at[named], middles, [words[row] for row in named], SCREEN.text)
                recording.log([*panel.entity, "ends", "names"], *label)
        for row in chosen:
            F, name = points[row].objectives[None], f"point {points[row].id}{of}"
            self.log_points(recording, "chosen", F, ids=np.array([points[row].id]), names=[name])
            self.log_label(recording, "chosen", F, f"{name}\n{words[row]}".rstrip(), avoid=avoid)

    def log_looked_at(
        self, recording: rr.RecordingStream, point: RecordedPoint, *, marked: Sequence[RecordedPoint], avoid: Area
    ) -> None:
        """Mark the point looked at, in addition to the chosen one and the best of the objectives."""
        F, name, lines = point.objectives[None], f"point {point.id}", NO_LINES
        words = name
        for each in (each for each in marked if each.axis is None):
            words = "" if each.id == point.id else name
            said = f"point {each.id}\n{self._best_words(marked, each)}".rstrip()
            for panel in self.panels[:1]:
                if panel.shows(each.objectives[None])[0]:
                    at = panel.place(each.objectives[None])
                    middle = label_place(panel.canvas, at[0], said, np.concatenate([at, avoid]))
                    avoid = np.concatenate([avoid, label_area(middle, said)])
                    lines = label_lines(at[0], middle, said)
        self.log_points(recording, "looked_at", F, ids=np.array([point.id]), names=[name])
        self.log_label(recording, "looked_at", F, words, avoid=avoid, lines=lines)

    def _best_words(self, points: Sequence[RecordedPoint], one: RecordedPoint) -> str:
        """Return the objectives in which a point is best, one per line."""
        same = [point.axis for point in points if point.axis is not None and point.id == one.id]
        return "\n".join(f"best {screen_text(self.scene.names[axis])}" for axis in same)

    def _moves(self, panel: Panel, generation: Generation) -> Float[np.ndarray, "moves 2 2"]:
        """Return the move of each refined point from its origin as a line [pixels]; none without origins."""
        origins = generation.front[:0] if generation.origins is None else generation.origins
        ends = generation.front[: len(origins)]
        seen = panel.shows(origins) & panel.shows(ends)
        return np.stack([panel.place(origins[seen]), panel.place(ends[seen])], axis=1)

    def _bounds(self, panel: Panel, generation: Generation) -> list[Bound]:
        """Return the finite bounds ε that a panel shows, each with words at its end."""
        scene, canvas, lines, words = self.scene, panel.canvas, list[np.ndarray](), list[str]()
        for place, axis in enumerate(panel.pair if generation.epsilon is not None else ()):
            bound = float(generation.epsilon[axis])  # type: ignore[index]
            if np.isfinite(bound) and canvas.low[place] <= bound <= canvas.high[place]:
                line = np.stack([canvas.low, canvas.high])
                line[:, place] = bound
                lines.append(canvas.place(line))
                sense = "≥" if scene.maximised[axis] else "≤"
                words.append(f"ε: {screen_text(scene.names[axis])} {sense} {bound:.4g} {scene.units[axis]}".rstrip())
        taken, bounds = line_points(lines), list[Bound]()
        for line, said in reversed(list(zip(lines, words, strict=True))):  # labels of vertical lines can be lower
            middle = label_place(canvas, line[-1], said, taken, is_joined=False)
            taken = np.concatenate([taken, label_area(middle, said)])
            bounds.append((line, said, middle))
        return bounds[::-1]

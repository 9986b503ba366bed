"""The drawing of a front: one view with a panel per pair of objectives, ticks at its outer edges, names of points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise
from typing import Any, Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Ids, Objectives, Values
from paretoik.review.drawing.axes import TEXT, Canvas, axis_ranges, entity_names, labels, screen_text, window
from paretoik.review.drawing.label_places import joined_labels, label_area, label_lines, label_place, line_points
from paretoik.review.outlines import NO_LINES, Lines
from paretoik.review.palette import DRAWING, MARKS, SCREEN, VIEWS, Colour
from paretoik.review.recording.messages import RecordedPoint
from paretoik.review.recording.recorder import Generation, Population, SearchedFront

NO_POINTS = np.zeros((0, 2))
Area = Float[np.ndarray, "area 2"]  # points [pixels] that labels avoid
Bound = tuple[Float[np.ndarray, "2 2"], str, Float[np.ndarray, " 2"]]  # a line, its words and their middle [pixels]
Pair = tuple[int, int]
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
        return Canvas(
            low=low,
            high=high,
            labels=(self.labels[first], self.labels[second]),
            width=width,
            height=height,
            origin=np.array([column * (width + across), row * (height + below)]),
            ticked=(row == rows - 1, column == 0) if matrix else (True, True),
            label_drop=self._stagger * (column % 2) if matrix else 0.0,
            overhang=0.45 * across if columns > 1 else TEXT.right,
            right_edge=VIEWS.panels[0] - TEXT.left,
            side_room=(columns - 1 - column) * (width + across) if matrix and column == row else 0.0,
        )

    @property
    def _stagger(self) -> float:
        """Distance by which every second lower label is moved down, if labels would overlap."""
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Scatter:
    """The fronts of a ``scene`` on axes that contain all of ``shown``, below the entity ``root``."""

    scene: SearchedFront
    shown: Objectives
    root: tuple[str, ...] = ()

    @cached_property
    def panels(self) -> Panels:
        """The panels of pairs of objectives."""
        scene, is_step = self.scene, self.scene.timeline == "step"
        words = [f"{name}, share of its range" if is_step else scene.label(k) for k, name in enumerate(scene.names)]
        return Panels(labels=tuple(map(screen_text, words)))

    @cached_property
    def canvases(self) -> list[tuple[Pair, list[str], Canvas]]:
        """Each pair of objectives with the entity and the canvas of its panel; none without a finite point."""
        finite = self.shown[np.isfinite(self.shown).all(axis=1)]
        if self.scene.timeline == "step" and len(finite):  # shares of ranges
            finite = np.array([[0.0], [1.0]]) * np.ones(len(self.scene.names))
        names = entity_names(self.scene.names)
        return [
            (pair, [*self.root, "front", f"{names[pair[0]]} - {names[pair[1]]}"], canvas)
            for pair, canvas in zip(self.panels.pairs, self.panels.canvases(finite), strict=False)
        ]

    def outside(self, F: Objectives) -> int:
        """Return how many points at least one panel does not show; 0 without panels."""
        seen = [canvas.shows(F[:, list(pair)]) for pair, _, canvas in self.canvases]
        return int((~np.all(seen, axis=0)).sum()) if seen else 0

    def shows_any(self, F: Objectives) -> bool:
        """Return whether any panel shows any of the points."""
        return any(canvas.shows(F[:, list(pair)]).any() for pair, _, canvas in self.canvases)

    def view(self) -> rrb.View | None:
        """Return the view of all pairs; None if nothing finite is shown."""
        if not self.canvases:
            return None
        return rrb.Spatial2DView(
            origin=rr.new_entity_path([*self.root, "front"]),
            name="front" if self.scene.timeline != "step" else "front, as shares of its ranges",
            visual_bounds=self.panels.bounds(),
            background=SCREEN.background,
        )

    def log_axes(self, recording: rr.RecordingStream) -> None:
        """Draw all axes, for all times."""
        for _, entity, canvas in self.canvases:
            canvas.log(recording, rr.new_entity_path(entity))

    def log_generation(
        self, recording: rr.RecordingStream, generation: Generation, *, behind: Population | None = None
    ) -> None:
        """Draw a generation at the current time, and record its exact numbers; labels also avoid points ``behind``."""
        timeline = self.scene.timeline
        reference = generation.front if timeline == "step" else None
        self.log_points(recording, "population", generation.population, reference=reference)
        self.log_points(recording, "front", generation.front, ids=generation.front_ids, reference=reference)
        for pair, entity, canvas in self.canvases:
            if timeline == "refinement":
                moves = self._moves(canvas, pair, generation)
                style: Any = {"colors": SCREEN.moves, "radii": rr.Radius.ui_points(0.8), "draw_order": 1.5}
                arrows = rr.Arrows2D(origins=moves[:, 0], vectors=moves[:, 1] - moves[:, 0], **style)
                recording.log([*entity, "moves"], arrows)
            elif timeline == "level":
                bounds = self._bounds(canvas, pair, generation)
                ends, middles = [line for line, _, _ in bounds], [NO_POINTS, *(each[None] for _, _, each in bounds)]
                lines = rr.LineStrips2D(ends, colors=SCREEN.epsilon, radii=rr.Radius.ui_points(1.0), draw_order=0.5)
                recording.log([*entity, "epsilon"], lines)
                names = labels([words for _, words, _ in bounds], np.concatenate(middles), SCREEN.epsilon)
                recording.log([*entity, "epsilon", "names"], names)
        if generation.chosen is not None:
            self.log_points(recording, "chosen", generation.chosen[None], reference=reference)
            self.log_label(recording, "chosen", generation.chosen[None], "")
        of = f" of level {generation.number}" if timeline == "level" else ""  # the final front renumbers
        everything = np.concatenate([generation.front, generation.population, *([] if behind is None else [behind])])
        taken = self.line_points(generation)
        self.log_marked(recording, generation.points, of=of, avoided=everything, taken=taken)

    def log_note(self, recording: rr.RecordingStream, words: str) -> None:
        """Write a note into every panel at the current time; without words, remove it."""
        for _, entity, canvas in self.canvases:
            middle = canvas.origin + 0.5 * np.array([canvas.width, canvas.height])
            recording.log([*entity, "note"], labels([words], middle[None]) if words else rr.Points2D([]))

    def line_points(self, generation: Generation) -> Area:
        """Return points [pixels] on the lines of a generation in the first panel, which has the labels of points."""
        for pair, _, canvas in self.canvases[:1]:
            if self.scene.timeline == "refinement":
                return line_points(self._moves(canvas, pair, generation))
            if self.scene.timeline == "level":
                bounds = self._bounds(canvas, pair, generation)
                areas = [label_area(middle, words) for _, words, middle in bounds]
                return np.concatenate([line_points(np.array([line for line, _, _ in bounds])), *areas])
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
        """Draw points as a layer of every panel, normalised by the ranges of a ``reference`` front if there is one.

        Points outside a window are not drawn, but their numbers are recorded. ``names`` are visible under the mouse.
        """
        colour, radius, order = LAYERS[layer]
        drawn = F if reference is None else normalised(F, reference)
        for pair, entity, canvas in self.canvases:
            seen = canvas.shows(drawn[:, list(pair)])
            points = rr.Points2D(
                canvas.place(drawn[seen][:, list(pair)]),
                colors=colour,
                radii=rr.Radius.ui_points(radius),
                labels=None if names is None else [names[row] for row in np.flatnonzero(seen).tolist()],
                show_labels=False,
                draw_order=order,
            )
            recording.log([*entity, layer], points, static=static)
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
        avoided: Population | None = None,
        taken: Area = NO_POINTS,
        lines: Lines = NO_LINES,
        static: bool = False,
    ) -> None:
        """Label the point F (1, n_obj) of a layer in the first panel; without words, remove the label.

        The label covers as few as possible of the points ``avoided`` and ``taken`` [pixels]; its line crosses none of
        ``lines``.
        """
        for pair, entity, canvas in self.canvases[:1]:
            marks = canvas.place(F[:, list(pair)][canvas.shows(F[:, list(pair)])]) if words else NO_POINTS
            others = np.concatenate([F, F[:0] if avoided is None else avoided])[:, list(pair)]
            others = np.concatenate([canvas.place(others), taken])
            middles = [label_place(canvas, mark, words, others, lines) for mark in marks]
            label = joined_labels(marks, middles, [words] * len(marks), LAYERS[layer][0])
            recording.log([*entity, layer, "name"], *label, static=static)

    def log_marked(
        self,
        recording: rr.RecordingStream,
        points: Sequence[RecordedPoint],
        *,
        of: str = "",
        avoided: Population,
        taken: Area,
    ) -> None:
        """Draw the best points of the objectives in their colours, and the chosen one.

        If several coincide, or one coincides with the chosen one, each mark is a ring around the next. Their labels
        avoid ``avoided`` and ``taken`` [pixels]. ``of``: words after their ids, such as " of level 3".
        """
        ends = [row for row, point in enumerate(points) if point.axis is not None]
        chosen = [row for row, point in enumerate(points) if point.axis is None]
        words = [self._best_words(points, row) for row in range(len(points))]
        for number, (pair, entity, canvas) in enumerate(self.canvases if ends else ()):
            places = np.array([point.objectives[list(pair)] for point in points])
            at = canvas.place(places)
            marks = [row for row in ends if canvas.shows(places[row, None])[0]]
            near = np.linalg.norm(at[marks, None] - at[[*marks, *chosen]], axis=2) < MARKS.end
            markers = rr.Points2D(
                at[marks],
                colors=[SCREEN.end(points[row].axis or 0) for row in marks],
                # a later mark is drawn above, the chosen point above all
                radii=rr.Radius.ui_points(MARKS.end + MARKS.ring * np.triu(near, k=1).sum(axis=1)),
                labels=[f"point {points[row].id}{of}, {', '.join(words[row].splitlines())}" for row in marks],
                show_labels=False,
                draw_order=3.0,
            )
            recording.log([*entity, "ends"], markers)
            if number == 0:  # names of points that are best in several objectives
                shared = {words[row]: row for row in marks if "\n" in words[row]}
                own = {points[row].id for row in chosen}
                named = [row for row in shared.values() if points[row].id not in own]
                others = np.concatenate([at, canvas.place(avoided[:, list(pair)]), taken])
                middles = [label_place(canvas, at[row], words[row], others) for row in named]
                label = joined_labels(at[named], middles, [words[row] for row in named], SCREEN.text)
                recording.log([*entity, "ends", "names"], *label)
        for row in chosen:
            F, name = points[row].objectives[None], f"point {points[row].id}{of}"
            self.log_points(recording, "chosen", F, ids=np.array([points[row].id]), names=[name])
            said = f"{name}\n{words[row]}".rstrip()
            self.log_label(recording, "chosen", F, said, avoided=avoided, taken=taken)

    def log_looked_at(
        self,
        recording: rr.RecordingStream,
        point: RecordedPoint,
        *,
        avoided: Population,
        marked: Sequence[RecordedPoint],
        taken: Area,
    ) -> None:
        """Mark a point that is looked at, next to the chosen one and the best of the objectives.

        Its label avoids ``avoided``, ``taken`` and the label of the chosen point among the ``marked`` ones; the chosen
        point itself keeps its label.
        """
        F, name, lines = point.objectives[None], f"point {point.id}", NO_LINES
        words = name
        for row, each in enumerate(marked):
            if each.axis is None:
                words = "" if each.id == point.id else name
                said = f"point {each.id}\n{self._best_words(marked, row)}".rstrip()
                for pair, _, canvas in self.canvases[:1]:
                    places = np.concatenate([each.objectives[None], avoided])[:, list(pair)]
                    if canvas.shows(places[:1])[0]:
                        at = canvas.place(places)
                        middle = label_place(canvas, at[0], said, np.concatenate([at, taken]))
                        taken = np.concatenate([taken, label_area(middle, said)])
                        lines = label_lines(at[0], middle, said)
        self.log_points(recording, "looked_at", F, ids=np.array([point.id]), names=[name])
        self.log_label(recording, "looked_at", F, words, avoided=avoided, taken=taken, lines=lines)

    def _best_words(self, points: Sequence[RecordedPoint], row: int) -> str:
        """Return the objectives in which a row's point is best, one per line."""
        same = [point.axis for point in points if point.axis is not None and point.id == points[row].id]
        return "\n".join(f"best {screen_text(self.scene.names[axis])}" for axis in same)

    def _moves(self, canvas: Canvas, pair: Pair, generation: Generation) -> Float[np.ndarray, "moves 2 2"]:
        """Return the move of each refined point from its origin as a line [pixels]; none without origins."""
        front = generation.front[:, list(pair)]
        origins = front[:0] if generation.origins is None else generation.origins[:, list(pair)]
        ends = front[: len(origins)]
        seen = canvas.shows(origins) & canvas.shows(ends)
        return np.stack([canvas.place(origins[seen]), canvas.place(ends[seen])], axis=1)

    def _bounds(self, canvas: Canvas, pair: Pair, generation: Generation) -> list[Bound]:
        """Return the finite bounds ε of a level's two objectives that a panel shows, each with words at its end."""
        scene, lines, words = self.scene, list[np.ndarray](), list[str]()
        for place, axis in enumerate(pair if generation.epsilon is not None else ()):
            bound = float(generation.epsilon[axis])  # type: ignore[index]
            if np.isfinite(bound) and canvas.low[place] <= bound <= canvas.high[place]:
                line = np.stack([canvas.low, canvas.high])
                line[:, place] = bound
                lines.append(canvas.place(line))
                sense = "≥" if scene.maximised[axis] else "≤"
                words.append(f"ε: {screen_text(scene.names[axis])} {sense} {bound:.4g} {scene.units[axis]}".rstrip())
        taken, bounds = line_points(np.array(lines).reshape(-1, 2, 2)), list[Bound]()
        for line, said in reversed(list(zip(lines, words, strict=True))):  # those next to a vertical line can go lower
            middle = label_place(canvas, line[-1], said, taken, is_joined=False)
            taken = np.concatenate([taken, label_area(middle, said)])
            bounds.append((line, said, middle))
        return bounds[::-1]

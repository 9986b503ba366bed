"""The drawing of a search: a scatter of every pair of objectives, and parallel coordinates of all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Ids, Objectives, Values
from paretoik.formulations.protocol import Timeline
from paretoik.review.drawing.axes import Canvas, ParallelAxes, entity_names, labels, screen_text
from paretoik.review.drawing.front_panels import (
    LAYERS,
    Layer,
    Pair,
    PanelLines,
    Panels,
    best_words,
    layer_points,
    log_ends,
    normalised,
)
from paretoik.review.drawing.labels import Labelled, log_name, named_area
from paretoik.review.palette import DRAWING, SCREEN, screen_label
from paretoik.review.recording.messages import RecordedPoint
from paretoik.review.recording.recorder import Generation, Population, SearchedFront


@dataclass(frozen=True, kw_only=True)
class SearchScene:
    """Names, units and senses of the objectives, for drawing every generation below the entity ``root``.

    ``timeline`` says what generations are: generations, levels of an ε-sweep, a front before and after refinement, or
    steps of a closed loop. Steps have no hypervolume, and each is drawn as shares of its own front's ranges, because
    objectives can change by orders of magnitude between steps.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    maximised: tuple[bool, ...]
    timeline: Timeline = "generation"
    root: tuple[str, ...] = ()

    @property
    def panels(self) -> Panels:
        """The panels of pairs of objectives."""
        return Panels(labels=tuple(screen_text(self._axis(axis)) for axis in range(len(self.names))))

    @cached_property
    def entities(self) -> list[str]:
        """The objectives' names as parts of entity paths."""
        return entity_names(self.names)

    def canvases(self, shown: Objectives) -> list[Canvas]:
        """Return one canvas per pair of objectives, scaled to show `shown`; none if it has no finite point."""
        if self.timeline == "step" and np.isfinite(shown).all(axis=1).any():
            shown = np.array([[0.0], [1.0]]) * np.ones(len(self.names))
        return self.panels.canvases(shown)

    def fits(self, canvases: Sequence[Canvas], shown: Objectives) -> bool:
        """Return whether `shown` fits the present `canvases`."""
        if self.timeline == "step":
            return bool(canvases)
        return bool(canvases) and all(canvas.fits(shown[:, list(pair)]) for pair, canvas in self._panels(canvases))

    def view(self) -> rrb.View:
        """Return the view of all pairs."""
        return rrb.Spatial2DView(
            origin=rr.new_entity_path([*self.root, "front"]),
            name="front" if self.timeline != "step" else "front, as shares of its ranges",
            visual_bounds=self.panels.bounds(),
            background=SCREEN.background,
        )

    def parallel_axes(self, shown: Objectives) -> ParallelAxes | None:
        """Return axes for parallel coordinates, for three or more objectives."""
        shown = shown[np.isfinite(shown).all(axis=1)]
        if len(self.names) < DRAWING.parallel or not len(shown):
            return None
        if self.timeline == "step":
            shown = np.array([[0.0], [1.0]]) * np.ones(len(self.names))
        return ParallelAxes.around(rr.new_entity_path([*self.root, "parallel"]).lstrip("/"), self.panels.labels, shown)

    def log_axes(self, recording: rr.RecordingStream, canvases: Sequence[Canvas], *, static: bool) -> None:
        """Draw the axes of every panel, for all times (static) or for the current generation."""
        for pair, canvas in self._panels(canvases):
            canvas.log(recording, rr.new_entity_path(self._panel(pair)), static=static)

    def log_generation(
        self,
        recording: rr.RecordingStream,
        generation: Generation,
        canvases: Sequence[Canvas],
        parallel: ParallelAxes | None = None,
        *,
        named: bool = False,
        behind: Population | None = None,
    ) -> None:
        """Draw `generation` at the current time, its front with ids if `named`, and record its exact numbers.

        Labels also avoid the points ``behind`` it.
        """
        reference = generation.front if self.timeline == "step" else None
        self.log_points(recording, "population", generation.population, canvases, reference=reference)
        self.log_points(
            recording, "front", generation.front, canvases, ids=generation.front_ids, named=named, reference=reference
        )
        for pair, canvas in self._panels(canvases):
            self._lines.log(recording, self._panel(pair), canvas, pair, generation)
        if generation.chosen is not None:
            self.log_points(recording, "chosen", generation.chosen[None], canvases, reference=reference)
        of = f" of level {generation.number}" if self.timeline == "level" else ""  # the final front renumbers
        everything = [generation.front, generation.population, *([] if behind is None else [behind])]
        taken = self.line_points(generation, canvases)
        self.log_marked(recording, generation.points, canvases, of=of, avoided=np.concatenate(everything), taken=taken)
        if parallel is not None:
            marked = [point.objectives for point in generation.points if point.axis is None]
            chosen = marked[0] if marked else generation.chosen
            self.log_lines(recording, parallel, generation.front, chosen, reference=reference)

    def log_note(self, recording: rr.RecordingStream, canvases: Sequence[Canvas], words: str) -> None:
        """Explain in the middle of every panel why it has no points, at the current time; without words, stop."""
        for pair, canvas in self._panels(canvases):
            middle = canvas.origin + 0.5 * np.array([canvas.width, canvas.height])
            recording.log([*self._panel(pair), "note"], labels([words], middle[None]) if words else rr.Points2D([]))

    def line_points(self, generation: Generation, canvases: Sequence[Canvas]) -> Float[np.ndarray, "points 2"]:
        """Return points [pixels] on the lines of a generation in the first panel, which has the labels of points."""
        return self._lines.points(canvases[0], self.panels.pairs[0], generation) if canvases else np.zeros((0, 2))

    def log_points(
        self,
        recording: rr.RecordingStream,
        layer: Layer,
        F: Objectives,
        canvases: Sequence[Canvas],
        *,
        ids: Ids | None = None,
        named: bool = False,
        of: str = "",
        reference: Population | None = None,
        static: bool = False,
        avoided: Population | None = None,
        words: Sequence[str] | None = None,
        labelled: Labelled | None = None,
        taken: Float[np.ndarray, "area 2"] | None = None,
    ) -> None:
        """Draw points as a layer of every panel, normalised by the ranges of a ``reference`` front if there is one.

        Points outside a window are not drawn, but their numbers are recorded. If points are ``named``, ``of`` says
        whose ids they have. A chosen point or one that is looked at has a label, ``words`` or its name, which covers
        least of the points ``avoided``, of what is ``taken`` [pixels] and of the label of the point ``labelled``.
        """
        colour, _, order = LAYERS[layer]
        drawn = F if reference is None else normalised(F, reference)
        names = [f"point {number}{of}" for number in ids] if named and ids is not None else None
        for pair, canvas in self._panels(canvases):
            pairwise = drawn[:, list(pair)]
            seen = canvas.shows(pairwise)
            hovered = None if names is None else [names[row] for row in np.flatnonzero(seen)]
            points = layer_points(layer, canvas.place(pairwise[seen]), hovered)
            recording.log([*self._panel(pair), layer], points, static=static)
            if order > 3.0 and pair == self.panels.pairs[0]:
                shown = names if words is None else words
                area, lines = named_area(canvas, labelled, list(pair), avoided, taken)
                others = pairwise if avoided is None else np.concatenate([pairwise, avoided[:, list(pair)]])
                entity = [*self._panel(pair), layer, "name"]
                log_name(recording, entity, canvas, shown, others, colour, static, area, lines)
        if layer != "final":
            numbers: dict[str, Any] = {} if ids is None else {"ids": ids}
            values = rr.AnyValues(F=F.ravel(), n_obj=F.shape[1], **numbers)
            recording.log([*self.root, "search", layer], values, static=static)

    def log_marked(
        self,
        recording: rr.RecordingStream,
        points: Sequence[RecordedPoint],
        canvases: Sequence[Canvas],
        *,
        of: str = "",
        avoided: Population | None = None,
        taken: Float[np.ndarray, "area 2"] | None = None,
    ) -> None:
        """Draw the best points of the objectives in their colours, and the chosen one.

        Their labels avoid ``avoided`` and ``taken`` [pixels]. ``of`` says whose ids they have.
        """
        ends = any(point.axis is not None for point in points)
        for pair, canvas in self._panels(canvases) if ends else ():
            columns = list(pair)
            places = np.array([point.objectives[columns] for point in points])
            others = places[:0] if avoided is None else avoided[:, columns]
            named = others if pair == self.panels.pairs[0] else None
            log_ends(recording, self._panel(pair), canvas, places, points, self.names, named, of=of, taken=taken)
        for row, point in enumerate(points):
            if point.axis is None:
                words = [self._chosen_words(points, row, of)]
                ids, F = np.array([point.id]), point.objectives[None]
                self.log_points(
                    recording,
                    "chosen",
                    F,
                    canvases,
                    ids=ids,
                    named=True,
                    avoided=avoided,
                    of=of,
                    words=words,
                    taken=taken,
                )

    def log_looked_at(
        self,
        recording: rr.RecordingStream,
        point: RecordedPoint,
        canvases: Sequence[Canvas],
        parallel: ParallelAxes | None,
        *,
        avoided: Population | None = None,
        marked: Sequence[RecordedPoint] = (),
        taken: Float[np.ndarray, "area 2"] | None = None,
    ) -> None:
        """Mark a point that is looked at, next to the chosen one and the best of the objectives.

        Its label is off ``avoided``, ``taken`` and the label of the chosen one among the ``marked`` points; if it is
        the chosen point, it keeps that label.
        """
        F, ids = point.objectives[None], np.array([point.id])
        chosen = [row for row, each in enumerate(marked) if each.axis is None]
        words = () if any(marked[row].id == point.id for row in chosen) else None
        labelled = next(((marked[row].objectives, self._chosen_words(marked, row, "")) for row in chosen), None)
        self.log_points(
            recording,
            "looked_at",
            F,
            canvases,
            ids=ids,
            named=True,
            avoided=avoided,
            words=words,
            labelled=labelled,
            taken=taken,
        )
        if parallel is not None:
            recording.log(f"{parallel.entity}/looked_at", parallel.lines(F, SCREEN.arm, 2.2, 5.0))

    def log_lines(
        self,
        recording: rr.RecordingStream,
        parallel: ParallelAxes,
        front: Objectives,
        chosen: Values | None,
        *,
        reference: Population | None = None,
    ) -> None:
        """Draw a front in parallel coordinates, with its chosen point on top."""
        drawn = front if reference is None else normalised(front, reference)
        recording.log(f"{parallel.entity}/front", parallel.lines(drawn, SCREEN.front, 0.6, 1.0))
        if chosen is not None:
            row = chosen[None] if reference is None else normalised(chosen[None], reference)
            recording.log(f"{parallel.entity}/chosen", parallel.lines(row, SCREEN.chosen, 2.2, 4.0))

    def _chosen_words(self, points: Sequence[RecordedPoint], row: int, of: str) -> str:
        best = best_words(points, row, self.names)
        return f"point {points[row].id}{of}" + (f"\n{best}" if best else "")

    def label(self, axis: int) -> str:
        """Return the label of an objective."""
        return screen_label(self.names[axis], self.units[axis] or "1", self.maximised[axis])

    @property
    def _lines(self) -> PanelLines:
        return PanelLines(names=self.names, units=self.units, maximised=self.maximised, timeline=self.timeline)

    @property
    def volume_unit(self) -> str:
        """Unit of the hypervolume: the product of the objectives' units."""
        return " · ".join(unit for unit in self.units if unit) or "1"

    def best(self, front: Objectives) -> Values:
        """Return the best value of each objective on a front of at least one point."""
        best: Values = np.where(self.maximised, front.max(axis=0), front.min(axis=0))
        return best

    def _panels(self, canvases: Sequence[Canvas]) -> list[tuple[Pair, Canvas]]:
        """Return each pair with its canvas; none before the first finite point."""
        return list(zip(self.panels.pairs, canvases, strict=True)) if canvases else []

    def _panel(self, pair: Pair) -> list[str]:
        return [*self.root, "front", f"{self.entities[pair[0]]} - {self.entities[pair[1]]}"]

    def _axis(self, axis: int) -> str:
        return f"{self.names[axis]}, share of its range" if self.timeline == "step" else self.label(axis)


def search_scene(scene: SearchedFront) -> SearchScene:
    """Return how the fronts of a search are drawn."""
    return SearchScene(names=scene.names, units=scene.units, maximised=scene.maximised, timeline=scene.timeline)

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
    Bound,
    Layer,
    Pair,
    Panels,
    best_words,
    bound_points,
    bounds_in,
    log_bounds,
    log_ends,
    log_moves,
    normalised,
)
from paretoik.review.drawing.labels import Labelled, line_points, log_name, named_area
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

    @cached_property
    def panels(self) -> Panels:
        """The panels of pairs of objectives."""
        words = [
            f"{name}, share of its range" if self.timeline == "step" else self.label(axis)
            for axis, name in enumerate(self.names)
        ]
        return Panels(labels=tuple(map(screen_text, words)))

    @cached_property
    def entities(self) -> list[str]:
        """The objectives' names as parts of entity paths."""
        return entity_names(self.names)

    def label(self, axis: int) -> str:
        """Return the label of an objective."""
        return screen_label(self.names[axis], self.units[axis] or "1", self.maximised[axis])

    @property
    def volume_unit(self) -> str:
        """Unit of the hypervolume: the product of the objectives' units."""
        return " · ".join(unit for unit in self.units if unit) or "1"

    def best(self, front: Objectives) -> Values:
        """Return the best value of each objective on a front of at least one point."""
        best: Values = np.where(self.maximised, front.max(axis=0), front.min(axis=0))
        return best


def search_scene(scene: SearchedFront) -> SearchScene:
    """Return how the fronts of a search are drawn."""
    return SearchScene(names=scene.names, units=scene.units, maximised=scene.maximised, timeline=scene.timeline)


@dataclass(frozen=True, kw_only=True, eq=False)
class Scatter:
    """The fronts of a ``scene`` on axes that contain all of ``shown``."""

    scene: SearchScene
    shown: Objectives

    @cached_property
    def canvases(self) -> list[Canvas]:
        """One canvas per pair of objectives; none without a finite point."""
        return self.scene.panels.canvases(self._finite)

    @cached_property
    def parallel(self) -> ParallelAxes | None:
        """The axes of parallel coordinates, for three or more objectives."""
        if len(self.scene.names) < DRAWING.parallel or not len(self._finite):
            return None
        entity = rr.new_entity_path([*self.scene.root, "parallel"]).lstrip("/")
        return ParallelAxes.around(entity, self.scene.panels.labels, self._finite)

    @cached_property
    def _finite(self) -> Objectives:
        """Finite points that axes contain; for steps, shares of ranges."""
        finite: Objectives = self.shown[np.isfinite(self.shown).all(axis=1)]
        if self.scene.timeline == "step" and len(finite):
            return np.array([[0.0], [1.0]]) * np.ones(len(self.scene.names))
        return finite

    def fits(self, F: Objectives) -> bool:
        """Return whether the axes show points, and not much more."""
        if self.scene.timeline == "step":
            return bool(self.canvases)
        return bool(self.canvases) and all(canvas.fits(F[:, list(pair)]) for pair, canvas in self._panels)

    def outside(self, F: Objectives) -> int:
        """Return how many points at least one panel does not show; 0 without panels."""
        seen = [canvas.shows(F[:, list(pair)]) for pair, canvas in self._panels]
        return int((~np.all(seen, axis=0)).sum()) if seen else 0

    def shows_any(self, F: Objectives) -> bool:
        """Return whether any panel shows any of the points."""
        return any(canvas.shows(F[:, list(pair)]).any() for pair, canvas in self._panels)

    def view(self) -> rrb.View | None:
        """Return the view of all pairs; None if nothing finite is shown."""
        if not self.canvases:
            return None
        return rrb.Spatial2DView(
            origin=rr.new_entity_path([*self.scene.root, "front"]),
            name="front" if self.scene.timeline != "step" else "front, as shares of its ranges",
            visual_bounds=self.scene.panels.bounds(),
            background=SCREEN.background,
        )

    def parallel_views(self) -> list[rrb.View]:
        """Return the view of parallel coordinates, if there are any."""
        return [] if self.parallel is None else [self.parallel.view()]

    def log_axes(self, recording: rr.RecordingStream, *, static: bool = True) -> None:
        """Draw all axes, for all times (static) or from the current one on."""
        for pair, canvas in self._panels:
            canvas.log(recording, rr.new_entity_path(self._panel(pair)), static=static)
        if self.parallel is not None:
            self.parallel.log(recording, static=static)

    def log_generation(
        self, recording: rr.RecordingStream, generation: Generation, *, behind: Population | None = None
    ) -> None:
        """Draw a generation at the current time, and record its exact numbers; labels also avoid points ``behind``."""
        timeline = self.scene.timeline
        reference = generation.front if timeline == "step" else None
        self.log_points(recording, "population", generation.population, reference=reference)
        self.log_points(recording, "front", generation.front, ids=generation.front_ids, reference=reference)
        for pair, canvas in self._panels:
            if timeline == "refinement":
                log_moves(recording, [*self._panel(pair), "moves"], self._moves(canvas, pair, generation))
            elif timeline == "level":
                log_bounds(recording, [*self._panel(pair), "epsilon"], self._bounds(canvas, pair, generation))
        if generation.chosen is not None:
            self.log_points(recording, "chosen", generation.chosen[None], reference=reference)
            self.log_label(recording, "chosen", generation.chosen[None], "")
        of = f" of level {generation.number}" if timeline == "level" else ""  # the final front renumbers
        everything = np.concatenate([generation.front, generation.population, *([] if behind is None else [behind])])
        taken = self.line_points(generation)
        self.log_marked(recording, generation.points, of=of, avoided=everything, taken=taken)
        marked = [point.objectives for point in generation.points if point.axis is None]
        self.log_lines(recording, generation.front, marked[0] if marked else generation.chosen, reference=reference)

    def log_note(self, recording: rr.RecordingStream, words: str) -> None:
        """Explain in the middle of every panel why it has no points, at the current time; without words, stop."""
        for pair, canvas in self._panels:
            middle = canvas.origin + 0.5 * np.array([canvas.width, canvas.height])
            recording.log([*self._panel(pair), "note"], labels([words], middle[None]) if words else rr.Points2D([]))

    def line_points(self, generation: Generation) -> Float[np.ndarray, "points 2"]:
        """Return points [pixels] on the lines of a generation in the first panel, which has the labels of points."""
        for pair, canvas in self._panels[:1]:
            if self.scene.timeline == "refinement":
                return line_points(self._moves(canvas, pair, generation))
            if self.scene.timeline == "level":
                return bound_points(self._bounds(canvas, pair, generation))
        return np.zeros((0, 2))

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
        for pair, canvas in self._panels:
            seen = canvas.shows(drawn[:, list(pair)])
            points = rr.Points2D(
                canvas.place(drawn[seen][:, list(pair)]),
                colors=colour,
                radii=rr.Radius.ui_points(radius),
                labels=None if names is None else [names[row] for row in np.flatnonzero(seen).tolist()],
                show_labels=False,
                draw_order=order,
            )
            recording.log([*self._panel(pair), layer], points, static=static)
        if layer != "final":
            numbers: dict[str, Any] = {} if ids is None else {"ids": ids}
            values = rr.AnyValues(F=F.ravel(), n_obj=F.shape[1], **numbers)
            recording.log([*self.scene.root, "search", layer], values, static=static)

    def log_label(
        self,
        recording: rr.RecordingStream,
        layer: Layer,
        F: Objectives,
        words: str,
        *,
        avoided: Population | None = None,
        taken: Float[np.ndarray, "area 2"] | None = None,
        labelled: Labelled | None = None,
        static: bool = False,
    ) -> None:
        """Label the point F (1, n_obj) of a layer in the first panel; without words, remove the label.

        It covers least of the points ``avoided``, of what is ``taken`` [pixels] and of the label of the point
        ``labelled``.
        """
        for pair, canvas in self._panels[:1]:
            columns, avoided = list(pair), F[:0] if avoided is None else avoided
            area, lines = named_area(canvas, labelled, columns, avoided, taken)
            places = np.concatenate([F, avoided])[:, columns]
            entity = [*self._panel(pair), layer, "name"]
            log_name(recording, entity, canvas, words, places, LAYERS[layer][0], static, area, lines)

    def log_marked(
        self,
        recording: rr.RecordingStream,
        points: Sequence[RecordedPoint],
        *,
        of: str = "",
        avoided: Population,
        taken: Float[np.ndarray, "area 2"],
    ) -> None:
        """Draw the best points of the objectives in their colours, and the chosen one.

        Their labels avoid ``avoided`` and ``taken`` [pixels]. ``of`` says whose ids they have.
        """
        ends = any(point.axis is not None for point in points)
        for pair, canvas in self._panels if ends else ():
            columns, entity = list(pair), self._panel(pair)
            places = np.array([point.objectives[columns] for point in points])
            others = avoided[:, columns] if pair == self.scene.panels.pairs[0] else None
            log_ends(recording, entity, canvas, places, points, self.scene.names, others, of=of, taken=taken)
        for row, point in enumerate(points):
            if point.axis is None:
                F, name = point.objectives[None], f"point {point.id}{of}"
                self.log_points(recording, "chosen", F, ids=np.array([point.id]), names=[name])
                words = self._chosen_words(points, row, of)
                self.log_label(recording, "chosen", F, words, avoided=avoided, taken=taken)

    def log_looked_at(
        self,
        recording: rr.RecordingStream,
        point: RecordedPoint,
        *,
        avoided: Population,
        marked: Sequence[RecordedPoint],
        taken: Float[np.ndarray, "area 2"],
    ) -> None:
        """Mark a point that is looked at, next to the chosen one and the best of the objectives.

        Its label is off ``avoided``, ``taken`` and the label of the chosen one among the ``marked`` points; if it is
        the chosen point, it keeps that label.
        """
        F, name = point.objectives[None], f"point {point.id}"
        chosen = [row for row, each in enumerate(marked) if each.axis is None]
        words = "" if any(marked[row].id == point.id for row in chosen) else name
        labelled = next(((marked[row].objectives, self._chosen_words(marked, row, "")) for row in chosen), None)
        self.log_points(recording, "looked_at", F, ids=np.array([point.id]), names=[name])
        self.log_label(recording, "looked_at", F, words, avoided=avoided, taken=taken, labelled=labelled)
        if self.parallel is not None:
            recording.log(f"{self.parallel.entity}/looked_at", self.parallel.lines(F, SCREEN.arm, 2.2, 5.0))

    def log_lines(
        self,
        recording: rr.RecordingStream,
        front: Objectives,
        chosen: Values | None,
        *,
        reference: Population | None = None,
    ) -> None:
        """Draw a front in parallel coordinates, if there are any, with its chosen point on top."""
        if self.parallel is None:
            return
        drawn = front if reference is None else normalised(front, reference)
        recording.log(f"{self.parallel.entity}/front", self.parallel.lines(drawn, SCREEN.front, 0.6, 1.0))
        if chosen is not None:
            row = chosen[None] if reference is None else normalised(chosen[None], reference)
            recording.log(f"{self.parallel.entity}/chosen", self.parallel.lines(row, SCREEN.chosen, 2.2, 4.0))

    def _chosen_words(self, points: Sequence[RecordedPoint], row: int, of: str) -> str:
        best = best_words(points, row, self.scene.names)
        return f"point {points[row].id}{of}" + (f"\n{best}" if best else "")

    def _moves(self, canvas: Canvas, pair: Pair, generation: Generation) -> Float[np.ndarray, "moves 2 2"]:
        """Return the move of each refined point from its origin as a line [pixels]; none without origins."""
        front = generation.front[:, list(pair)]
        origins = front[:0] if generation.origins is None else generation.origins[:, list(pair)]
        ends = front[: len(origins)]
        seen = canvas.shows(origins) & canvas.shows(ends)
        return np.stack([canvas.place(origins[seen]), canvas.place(ends[seen])], axis=1)

    def _bounds(self, canvas: Canvas, pair: Pair, generation: Generation) -> list[Bound]:
        """Return the bounds of a level's two objectives."""
        scene, epsilon = self.scene, None if generation.epsilon is None else generation.epsilon[list(pair)]
        first, second = ((screen_text(scene.names[axis]), scene.units[axis]) for axis in pair)
        return bounds_in(canvas, epsilon, (first, second), (scene.maximised[pair[0]], scene.maximised[pair[1]]))

    @cached_property
    def _panels(self) -> list[tuple[Pair, Canvas]]:
        """Each pair with its canvas; none without a finite point."""
        return list(zip(self.scene.panels.pairs, self.canvases, strict=True)) if self.canvases else []

    def _panel(self, pair: Pair) -> list[str]:
        entities = self.scene.entities
        return [*self.scene.root, "front", f"{entities[pair[0]]} - {entities[pair[1]]}"]

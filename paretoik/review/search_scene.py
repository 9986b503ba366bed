"""How a search is drawn in a recording: a panel a pair of objectives, and its indicators over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise, product
from typing import Any, Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Ids, Objectives, Times, Values
from paretoik.formulations.protocol import Timeline
from paretoik.review.curve_charts import Chart
from paretoik.review.drawn_axes import Canvas, window
from paretoik.review.palette import SCREEN, Colour, objective_label
from paretoik.review.panel_marks import log_epsilon, log_moves
from paretoik.review.recorder import Generation, Population

Layer = Literal["population", "front", "chosen"]
LAYERS: dict[Layer, tuple[Colour, float, float]] = {  # colour, radius, which is drawn above which
    "population": (SCREEN.population, 2.2, 1.0),
    "front": (SCREEN.front, 3.2, 2.0),
    "chosen": (SCREEN.chosen, 6.5, 3.0),
}


@dataclass(frozen=True, kw_only=True)
class SearchScene:
    """Names and units of the objectives, and which are maximised: what every generation is drawn with.

    ``timeline`` says what they are: generations, steps of an ε-sweep, a front before and after it was refined, or steps
    of a closed loop. These have no hypervolume, and each is drawn as shares of its own front's ranges: from one to the
    next objectives can change by orders of magnitude.
    Points are drawn below the entity ``root``.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    maximised: tuple[bool, ...]
    timeline: Timeline = "generation"
    root: tuple[str, ...] = ()

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """The pairs of objectives that get a panel: all up to four objectives, neighbours beyond."""
        n_obj = len(self.names)
        return list(combinations(range(n_obj), 2) if n_obj <= 4 else pairwise(range(n_obj)))

    def canvases(self, shown: Objectives) -> list[Canvas]:
        """Return a canvas a pair of objectives whose windows hold `shown`, none where it has no finite point."""
        shown = shown[np.isfinite(shown).all(axis=1)]
        if len(shown) == 0:
            return []
        if self.timeline == "step":
            shown = np.array([[0.0], [1.0]]) * np.ones(len(self.names))
        text = 3.2 * min(self.columns, 2)
        windows = [window(shown[:, list(pair)]) for pair in self.pairs]
        return [
            Canvas(low=low, high=high, labels=(self._axis(first), self._axis(second)), text=text)
            for (first, second), (low, high) in zip(self.pairs, windows, strict=True)
        ]

    def fits(self, canvases: Sequence[Canvas], shown: Objectives) -> bool:
        """Say whether `shown` can be drawn on `canvases` as they are."""
        if self.timeline == "step":
            return bool(canvases)
        return bool(canvases) and all(canvas.fits(shown[:, list(pair)]) for pair, canvas in self._panels(canvases))

    @property
    def columns(self) -> int:
        """How many panels stand side by side."""
        return max(1, min(3 if len(self.pairs) > 4 else 2, len(self.pairs)))

    def views(self, canvases: Sequence[Canvas]) -> list[rrb.View]:
        """Return the panels, titled by what they show."""
        return [
            rrb.Spatial2DView(
                origin=rr.new_entity_path(self._panel(pair)),
                name=f"{self.names[pair[0]]} against {self.names[pair[1]]}",
                visual_bounds=canvas.bounds(),
                background=SCREEN.background,
            )
            for pair, canvas in self._panels(canvases)
        ]

    def series_views(self) -> list[rrb.View]:
        """Return the time series: hypervolume, best values, counts."""
        if self.timeline != "step":
            kinds, views = ["best"], [rrb.TimeSeriesView(origin="search/hypervolume", name="hypervolume")]
        else:
            kinds, views = ["chosen", "best"], []
        for kind, (axis, name) in product(kinds, enumerate(self.names)):
            origin = rr.new_entity_path(["search", kind, name])
            views.append(rrb.TimeSeriesView(origin=origin, name=f"{kind} {self._label(axis)}"))
        return [*views, rrb.TimeSeriesView(origin="search/counts", name="points and failures")]

    def charts(self, generations: Sequence[Generation]) -> list[Chart]:
        """Return the hypervolume over the generations, with a single objective its best value first.

        Of steps, each objective of the chosen points.
        """
        with_front = [generation for generation in generations if len(generation.front)]
        if not with_front:
            return []
        numbers = np.array([generation.number for generation in with_front], dtype=float)
        if self.timeline == "step":
            values = np.array([generation.chosen for generation in with_front])
            return [
                self._chart(f"chosen_{axis}", f"chosen {self._label(axis)}", numbers, values[:, axis], height=30.0)
                for axis in range(len(self.names))
            ]
        measured = [generation for generation in with_front if generation.hypervolume is not None]
        charts = []
        if measured:
            instants = np.array([generation.number for generation in measured], dtype=float)
            volumes = np.array([generation.hypervolume for generation in measured])
            charts.append(self._chart("hypervolume", "hypervolume", instants, volumes, height=30.0))
        if len(self.names) == 1:
            best = np.array([self._best(generation.front)[0] for generation in with_front])
            charts.insert(0, self._chart("best", f"best {self._label(0)}", numbers, best, height=100.0))
        return charts

    def log_styles(self, recording: rr.RecordingStream) -> None:
        """Give the time series their names and colours."""
        volume = rr.SeriesLines(names="hypervolume", colors=SCREEN.front[:3], widths=2.0)
        recording.log("search/hypervolume", volume, static=True)
        colours = [SCREEN.front[:3], SCREEN.failed[:3]]
        recording.log(
            "search/counts", rr.SeriesLines(names=["front", "failed"], colors=colours, widths=2.0), static=True
        )
        series = {"best": SCREEN.chosen} | ({"chosen": SCREEN.front} if self.timeline == "step" else {})
        for (kind, colour), (axis, name) in product(series.items(), enumerate(self.names)):
            style = rr.SeriesLines(names=f"{kind} {self._label(axis)}", colors=colour[:3], widths=2.0)
            recording.log(["search", kind, name], style, static=True)

    def log_axes(self, recording: rr.RecordingStream, canvases: Sequence[Canvas], *, static: bool) -> None:
        """Draw the axes of every panel, for all times (static) or for the current generation."""
        for pair, canvas in self._panels(canvases):
            canvas.log(recording, rr.new_entity_path(self._panel(pair)), static=static)

    def log_generation(
        self, recording: rr.RecordingStream, generation: Generation, canvases: Sequence[Canvas], *, named: bool = False
    ) -> None:
        """Draw `generation` at the current time, its front with ids if `named`, and keep its numbers exactly."""
        reference = generation.front if self.timeline == "step" else None
        self.log_points(recording, "population", generation.population, canvases, reference=reference)
        self.log_points(
            recording, "front", generation.front, canvases, ids=generation.front_ids, named=named, reference=reference
        )
        self._log_marks(recording, generation, canvases)
        if generation.hypervolume is not None:
            recording.log("search/hypervolume", rr.Scalars(generation.hypervolume))
        size = len(generation.front) if generation.size is None else generation.size
        recording.log("search/counts", rr.Scalars([float(size), float(generation.failed)]))
        if len(generation.front):
            for name, best in zip(self.names, self._best(generation.front), strict=True):
                recording.log(["search", "best", name], rr.Scalars(float(best)))
        if generation.chosen is not None:
            self.log_points(recording, "chosen", generation.chosen[None], canvases, reference=reference)
            for name, value in zip(self.names, generation.chosen, strict=True):
                recording.log(["search", "chosen", name], rr.Scalars(float(value)))

    def _log_marks(self, recording: rr.RecordingStream, generation: Generation, canvases: Sequence[Canvas]) -> None:
        """Draw the bounds of a step of a sweep, or where refined points came from."""
        if self.timeline not in ("point", "refinement"):
            return
        for (first, second), canvas in self._panels(canvases):
            columns = [first, second]
            if self.timeline == "refinement":
                origins = None if generation.origins is None else generation.origins[:, columns]
                entity = [*self._panel((first, second)), "moves"]
                log_moves(recording, entity, canvas, origins, generation.front[:, columns])
                continue
            log_epsilon(
                recording,
                [*self._panel((first, second)), "epsilon"],
                canvas,
                None if generation.epsilon is None else generation.epsilon[columns],
                (self.names[first], self.names[second]),
                (self.maximised[first], self.maximised[second]),
            )

    def log_points(
        self,
        recording: rr.RecordingStream,
        layer: Layer,
        F: Objectives,
        canvases: Sequence[Canvas],
        *,
        ids: Ids | None = None,
        named: bool = False,
        reference: Population | None = None,
    ) -> None:
        """Draw points as a layer of every panel, normalised by the ranges of a ``reference`` front if there is one.

        Points outside a window are not drawn, but their numbers are kept with the others.
        """
        colour, radius, order = LAYERS[layer]
        drawn = F if reference is None else _normalise(F, reference)
        for pair, canvas in self._panels(canvases):
            pairwise = drawn[:, list(pair)]
            seen = canvas.shows(pairwise)
            points = rr.Points2D(
                canvas.place(pairwise[seen]),
                colors=colour,
                radii=rr.Radius.ui_points(radius),
                labels=[f"point {number}" for number in ids[seen]] if named and ids is not None else None,
                show_labels=layer == "chosen",
                draw_order=order,
            )
            recording.log([*self._panel(pair), layer], points)
        numbers: dict[str, Any] = {"F": F.ravel(), "n_obj": F.shape[1]}
        recording.log([*self.root, "search", layer], rr.AnyValues(**numbers if ids is None else numbers | {"ids": ids}))

    def _panels(self, canvases: Sequence[Canvas]) -> list[tuple[tuple[int, int], Canvas]]:
        """Return each pair with its canvas; before there is a finite point there are none."""
        return list(zip(self.pairs, canvases, strict=True)) if canvases else []

    def _panel(self, pair: tuple[int, int]) -> list[str]:
        return [*self.root, "front", f"{self.names[pair[0]]} - {self.names[pair[1]]}"]

    def _best(self, front: Objectives) -> Values:
        best: Values = np.where(self.maximised, front.max(axis=0), front.min(axis=0))
        return best

    def _chart(self, name: str, label: str, numbers: Times, values: Values, *, height: float) -> Chart:
        return Chart(
            entity=f"charts/{name}",
            title=label,
            labels=(self.timeline, label),
            instants=numbers,
            curves=values[None],
            names=[name],
            colours=[SCREEN.front],
            width=190.0 if height < 100.0 else 140.0,
            height=height,
        )

    def _axis(self, axis: int) -> str:
        return f"{self.names[axis]}, share of the step's range" if self.timeline == "step" else self._label(axis)

    def _label(self, axis: int) -> str:
        return objective_label(self.names[axis], self.units[axis], self.maximised[axis])


def _normalise(F: Objectives, reference: Population) -> Objectives:
    low, width = reference.min(axis=0), np.ptp(reference, axis=0)
    normalised: Objectives = (F - low) / np.where(width > 0, width, 1.0)
    return normalised


def replay_window(fronts: Sequence[Float[np.ndarray, "_ n_obj"]]) -> Objectives:
    """Return corners (2, n_obj) around the last of `fronts` and, as far as they are near, those before it.

    An early front may lie far off; the window reaches at most one and a half of the final range beyond the final one.
    """
    everything, front = np.concatenate(fronts), fronts[-1]
    low, high = front.min(axis=0), front.max(axis=0)
    reach: Values = 1.5 * np.where(high > low, high - low, np.maximum(0.1 * np.abs(high), 1e-9))
    return np.stack([np.maximum(everything.min(axis=0), low - reach), np.minimum(everything.max(axis=0), high + reach)])

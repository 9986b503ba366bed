"""The course of a search over its generations or steps: charts at its end, time series while it runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.arrays import Objectives, Series, Times
from paretoik.review.drawing.axes import screen_text
from paretoik.review.drawing.charts import Chart, fit_below_tabs
from paretoik.review.drawing.layout import Entry, log_text
from paretoik.review.drawing.motion import MotionScene
from paretoik.review.drawing.scatter import Scatter, SearchScene
from paretoik.review.palette import MARKS, SCREEN, VIEWS, Colour
from paretoik.review.recording.recorder import Generation

# The legend of a search.


def search_entries(
    scene: SearchScene,
    motions: MotionScene | None,
    *,
    chosen: str = "compromise",
    walked: bool = False,
    postures: str = "",
) -> list[Entry]:
    """Return the names and colours in a search's drawing; with entries for the point looked at if ``walked``.

    ``postures``: name of those drawn behind arms that stand still, "" for none.
    """
    loop = scene.timeline == "step"
    behind = {"level": "dominated", "refinement": "before"}.get(scene.timeline, "population")
    entries: list[Entry] = [("front of the step" if loop else "front", SCREEN.front), (chosen, SCREEN.chosen)]
    if not loop:
        entries = [(behind, SCREEN.population), *entries, ("final front", SCREEN.final)]
        entries += [("ε: bound of this level", SCREEN.epsilon)] if scene.timeline == "level" else []
        entries += [("from before to after", SCREEN.moves)] if scene.timeline == "refinement" else []
        if len(scene.names) > 1:
            entries += [(f"best {name}", SCREEN.end(axis)) for axis, name in enumerate(scene.names)]
        entries += [("point looked at", SCREEN.arm)] if walked else []
    if motions is None:
        return entries
    arm = f"arm of the {chosen}" if chosen == "compromise" else "arm"
    arm = f"{arm}, or of the point looked at" if walked else arm
    return entries + motions.entries(arm, postures=postures)


# Charts and time series of a search.


def search_charts(scene: SearchScene, generations: Sequence[Generation]) -> list[Chart]:
    """Return the charts over the generations: hypervolume, best values and sizes; a single objective's best is first.

    For steps: each objective of the chosen points, between the best and the worst of the step's front.
    """
    with_front = [generation for generation in generations if len(generation.front)]
    if not with_front:
        return []
    numbers = np.array([generation.number for generation in with_front], dtype=float)
    if scene.timeline == "step":
        return [_step_chart(scene, axis, numbers, with_front) for axis in range(len(scene.names))]
    volumes = np.array([[np.nan if each.hypervolume is None else each.hypervolume for each in with_front]])
    label = f"hypervolume [{scene.volume_unit}]"
    volume = _chart(scene, "hypervolume", label, numbers, volumes, {"hypervolume": SCREEN.front})
    best = np.array([scene.best(generation.front) for generation in with_front]).T
    bests = [
        _chart(scene, f"best_{axis}", f"best {scene.label(axis)}", numbers, values[None], {"best": SCREEN.end(axis)})
        for axis, values in enumerate(best)
    ]
    counts = np.array([[front_size(generation), generation.failed] for generation in with_front], dtype=float).T
    colours = {"front": SCREEN.front, "failed": SCREEN.failed}
    sizes = _chart(scene, "counts", "front points, failures", numbers, counts, colours)
    return [*bests, volume, sizes] if len(scene.names) == 1 else [volume, *bests, sizes]


def series_views(scene: SearchScene) -> list[rrb.View]:
    """Return growing time series: hypervolume, chosen and best values, sizes."""
    kinds = ["best"] if scene.timeline != "step" else ["chosen", "best"]
    volume = [rrb.TimeSeriesView(origin="search/hypervolume", name=screen_text(f"hypervolume [{scene.volume_unit}]"))]
    views = [
        rrb.TimeSeriesView(
            origin=rr.new_entity_path(["search", kind, name]), name=screen_text(f"{kind} {scene.label(axis)}")
        )
        for kind in kinds
        for axis, name in enumerate(scene.entities)
    ]
    counts = rrb.TimeSeriesView(origin="search/counts", name="points and failures")
    return [*(volume if scene.timeline != "step" else []), *views, counts]


def log_styles(scene: SearchScene, recording: rr.RecordingStream) -> None:
    """Give the time series their names and colours."""
    volume = rr.SeriesLines(names="hypervolume", colors=SCREEN.front[:3], widths=2.0)
    recording.log("search/hypervolume", volume, static=True)
    colours = [SCREEN.front[:3], SCREEN.failed[:3]]
    recording.log("search/counts", rr.SeriesLines(names=["front", "failed"], colors=colours, widths=2.0), static=True)
    series = {"best": SCREEN.chosen} | ({"chosen": SCREEN.front} if scene.timeline == "step" else {})
    for kind, colour in series.items():
        for axis, name in enumerate(scene.entities):
            words = screen_text(f"{kind} {scene.label(axis)}")
            style = rr.SeriesLines(names=words, colors=colour[:3], widths=2.0)
            recording.log(["search", kind, name], style, static=True)


def log_series(scene: SearchScene, recording: rr.RecordingStream, generation: Generation) -> None:
    """Log the numbers of a generation at the current time."""
    if generation.hypervolume is not None:
        recording.log("search/hypervolume", rr.Scalars(generation.hypervolume))
    recording.log("search/counts", rr.Scalars([float(front_size(generation)), float(generation.failed)]))
    if len(generation.front):
        for name, best in zip(scene.entities, scene.best(generation.front), strict=True):
            recording.log(["search", "best", name], rr.Scalars(float(best)))
    if generation.chosen is not None:
        for name, value in zip(scene.entities, generation.chosen, strict=True):
            recording.log(["search", "chosen", name], rr.Scalars(float(value)))


def front_size(generation: Generation) -> int:
    """Return how many points the front of a generation has, drawn or not."""
    return len(generation.front) if generation.size is None else generation.size


def _step_chart(scene: SearchScene, axis: int, numbers: Times, steps: Sequence[Generation]) -> Chart:
    ranges = np.array([np.sort([each.front[:, axis].min(), each.front[:, axis].max()]) for each in steps])
    if scene.maximised[axis]:
        ranges = ranges[:, ::-1]
    chosen = np.array([np.nan if each.chosen is None else each.chosen[axis] for each in steps])
    curves = np.stack([ranges[:, 0], ranges[:, 1], chosen])
    chosen_colour, colours = {"chosen": SCREEN.chosen}, {"best": SCREEN.population, "worst": SCREEN.frame}
    apart, whole = np.nanmax(np.ptp(ranges, axis=1), initial=0.0), np.nanmax(curves) - np.nanmin(curves)
    if apart < MARKS.line * whole / VIEWS.chart[1]:  # the curves would overlap
        words = f"chosen {scene.label(axis)}; best and worst of a step at most {apart:.2g} apart"
        chart = _chart(scene, f"chosen_{axis}", words, numbers, curves[2:], chosen_colour)
        return replace(chart, title=scene.label(axis))
    return _chart(scene, f"chosen_{axis}", scene.label(axis), numbers, curves, colours | chosen_colour)


def _chart(
    scene: SearchScene, name: str, label: str, numbers: Times, curves: Series, colours: Mapping[str, Colour]
) -> Chart:
    """Return a chart of curves, whose names have ``colours``."""
    return Chart(
        entity=f"charts/{name}",
        title=label,
        labels=({"refinement": "refinement: 0 before, 1 after"}.get(scene.timeline, scene.timeline), label),
        names=list(colours),
        colours=list(colours.values()),
        instants=numbers,
        curves=curves,
    )


# Shared parts of recordings of finished searches and closed loops: views of fronts and their charts.


@dataclass(frozen=True, kw_only=True, eq=False)
class FrontViews:
    """The views of a search's fronts on the axes of a ``scatter``, and its charts over ``generations``.

    ``final``: the last front, if there is one.
    """

    scatter: Scatter
    generations: Sequence[Generation] = ()
    final: Objectives | None = None

    def log(self, stream: rr.RecordingStream, *, static: bool = True) -> None:
        """Draw axes, for all times (static) or from the current one on, and charts, for all times."""
        self.scatter.log_axes(stream, static=static)
        for chart in self._charts:
            chart.log(stream)

    def log_generation(self, stream: rr.RecordingStream, generation: Generation, words: str) -> None:
        """Draw a generation or step at the current time, with its text."""
        self.scatter.log_generation(stream, generation, behind=self.final)
        log_series(self.scatter.scene, stream, generation)
        log_text(stream, words)
        self.log_cursors(stream, generation.number)

    def log_cursors(self, stream: rr.RecordingStream, number: int) -> None:
        """Draw the cursors of charts at a generation or step, at the current time."""
        for chart in self._charts:
            chart.log_cursor(stream, float(number))

    @property
    def charts(self) -> list[rrb.View]:
        """The views below the front."""
        return [*self.scatter.parallel_views(), *(chart.view() for chart in self._charts)]

    @cached_property
    def _charts(self) -> list[Chart]:
        names_before = [str(view.name) for view in self.scatter.parallel_views()]
        return fit_below_tabs(search_charts(self.scatter.scene, self.generations), names_before)

"""How a search went, over its generations or steps: as charts at its end, as time series while it goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.arrays import Series, Times
from paretoik.review.drawing.curve_charts import Chart, fit_below_tabs
from paretoik.review.drawing.screen_text import screen_text
from paretoik.review.drawing.search_scene import SearchScene
from paretoik.review.drawing_options import MARKS, VIEWS
from paretoik.review.palette import SCREEN, Colour
from paretoik.review.recording.recorder import Generation

BEST_WORST: tuple[Colour, Colour] = (SCREEN.population, SCREEN.frame)
DrawnChart = tuple[Chart, np.ndarray, np.ndarray]  # with its instants and curves (curves, instants)


def search_charts(scene: SearchScene, generations: Sequence[Generation]) -> list[DrawnChart]:
    """Return the hypervolume over the generations, the best values and the sizes; with one objective its best first.

    Of steps, each objective of the chosen points between the best and the worst of the step's front.
    """
    with_front = [generation for generation in generations if len(generation.front)]
    if not with_front:
        return []
    numbers = np.array([generation.number for generation in with_front], dtype=float)
    if scene.timeline == "step":
        return [_step_chart(scene, axis, numbers, with_front) for axis in range(len(scene.names))]
    volumes = np.array([_number(generation.hypervolume) for generation in with_front])
    volume = _chart(
        scene,
        "hypervolume",
        f"hypervolume [{scene.volume_unit}]",
        numbers,
        volumes[None],
        ["hypervolume"],
        [SCREEN.front],
    )
    best = np.array([scene.best(generation.front) for generation in with_front]).T
    bests = [
        _chart(
            scene,
            f"best_{axis}",
            f"best {scene.label(axis)}",
            numbers,
            best[axis : axis + 1],
            ["best"],
            [SCREEN.end(axis)],
        )
        for axis in range(len(scene.names))
    ]
    counts = np.array([[front_size(generation), generation.failed] for generation in with_front], dtype=float).T
    colours = [SCREEN.front, SCREEN.failed]
    sizes = _chart(scene, "counts", "front points, failures", numbers, counts, ["front", "failed"], colours)
    return [*bests, volume, sizes] if len(scene.names) == 1 else [volume, *bests, sizes]


def fit_drawn_charts(drawn: Sequence[DrawnChart], names_before: Sequence[str] = ()) -> list[DrawnChart]:
    """Return charts as ``fit_below_tabs`` does, with what is drawn in them."""
    charts = fit_below_tabs([chart for chart, _, _ in drawn], names_before)
    return [(chart, instants, curves) for chart, (_, instants, curves) in zip(charts, drawn, strict=True)]


def series_views(scene: SearchScene) -> list[rrb.View]:
    """Return time series, which can grow: hypervolume, chosen and best values, sizes."""
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


def _step_chart(scene: SearchScene, axis: int, numbers: Times, steps: Sequence[Generation]) -> DrawnChart:
    ranges = np.array([np.sort([each.front[:, axis].min(), each.front[:, axis].max()]) for each in steps])
    if scene.maximised[axis]:
        ranges = ranges[:, ::-1]
    chosen = np.array([np.nan if each.chosen is None else each.chosen[axis] for each in steps])
    curves = np.stack([ranges[:, 0], ranges[:, 1], chosen])
    names, colours = ["best", "worst", "chosen"], [*BEST_WORST, SCREEN.chosen]
    apart, whole = np.nanmax(np.ptp(ranges, axis=1), initial=0.0), np.nanmax(curves) - np.nanmin(curves)
    if apart < MARKS.line * whole / VIEWS.chart[1]:  # they would lie under each other
        words = f"chosen {scene.label(axis)}; best and worst of a step at most {apart:.2g} apart"
        chart, *_ = _chart(scene, f"chosen_{axis}", words, numbers, curves[2:], names[2:], colours[2:])
        return replace(chart, title=scene.label(axis)), numbers, curves[2:]
    return _chart(scene, f"chosen_{axis}", scene.label(axis), numbers, curves, names, colours)


def _chart(
    scene: SearchScene,
    name: str,
    label: str,
    numbers: Times,
    curves: Series,
    names: Sequence[str],
    colours: Sequence[Colour],
) -> DrawnChart:
    chart = Chart(
        entity=f"charts/{name}",
        title=label,
        labels=({"refinement": "refinement: 0 before, 1 after"}.get(scene.timeline, scene.timeline), label),
        shown=np.stack([np.tile(numbers, len(curves)), curves.ravel()], axis=1),
        names=names,
        colours=colours,
    )
    return chart, numbers, curves


def _number(value: float | None) -> float:
    return float("nan") if value is None else value

"""The legend and the charts of searches and closed loops, over generations or steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from paretoik.arrays import Objectives
from paretoik.review.drawing.axes import entity_names
from paretoik.review.drawing.charts import Chart, fit_below_tabs
from paretoik.review.drawing.layout import Entry, log_text
from paretoik.review.drawing.motion import MotionScene
from paretoik.review.drawing.scatter import Scatter
from paretoik.review.palette import MARKS, SCREEN, VIEWS
from paretoik.review.recording.recorder import Generation, SearchedFront


def search_entries(
    scene: SearchedFront,
    motions: MotionScene | None,
    *,
    chosen: str = "compromise",
    walked: bool = False,
    postures: str = "",
) -> list[Entry]:
    """Return the names and colours in a search's drawing; with entries for the point looked at if ``walked``.

    ``postures``: name of the postures drawn behind arms that stand still, "" for none.
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


def search_charts(scene: SearchedFront, generations: Sequence[Generation]) -> list[Chart]:
    """Return the charts over the generations: hypervolume, best values and sizes; a single objective's best is first.

    For steps: each objective of the chosen points, between the best and the worst of the step's front.
    """
    shown = [generation for generation in generations if len(generation.front)]
    if not shown:
        return []
    numbers, charts = np.array([generation.number for generation in shown], dtype=float), list[Chart]()
    across = {"refinement": "refinement: 0 before, 1 after"}.get(scene.timeline, scene.timeline)
    if scene.timeline == "step":
        for axis in range(len(scene.names)):
            ranges = np.array([np.sort([each.front[:, axis].min(), each.front[:, axis].max()]) for each in shown])
            ranges = ranges[:, ::-1] if scene.maximised[axis] else ranges
            chosen = np.array([np.nan if each.chosen is None else each.chosen[axis] for each in shown])
            curves, names = np.stack([ranges[:, 0], ranges[:, 1], chosen]), ["best", "worst", "chosen"]
            label, colours = scene.label(axis), [SCREEN.population, SCREEN.frame, SCREEN.chosen]
            apart, whole = np.nanmax(np.ptp(ranges, axis=1), initial=0.0), np.nanmax(curves) - np.nanmin(curves)
            if apart < MARKS.line * whole / VIEWS.chart[1]:  # the curves would overlap
                label = f"chosen {label}; best and worst of a step at most {apart:.2g} apart"
                curves, names, colours = curves[2:], names[2:], colours[2:]
            more = {"names": names, "title": scene.label(axis)}
            charts.append(Chart.over(across, f"chosen_{axis}", label, numbers, curves, colours, **more))
        return fit_below_tabs(charts)
    volumes = np.array([[np.nan if each.hypervolume is None else each.hypervolume for each in shown]])
    label = f"hypervolume [{scene.volume_unit}]"
    volume = Chart.over(across, "hypervolume", label, numbers, volumes, [SCREEN.front])
    for axis, values in enumerate(np.array([scene.best(generation.front) for generation in shown]).T):
        label, colour = f"best {scene.label(axis)}", SCREEN.end(axis)
        charts.append(Chart.over(across, f"best_{axis}", label, numbers, values[None], [colour]))
    counts = np.array([[each.count, each.failed] for each in shown], dtype=float).T
    more, colours = {"names": ["front", "failed"]}, [SCREEN.front, SCREEN.failed]
    sizes = Chart.over(across, "counts", "front points, failures", numbers, counts, colours, **more)
    return fit_below_tabs([*charts, volume, sizes] if len(scene.names) == 1 else [volume, *charts, sizes])


def log_generation(
    stream: rr.RecordingStream,
    scatter: Scatter,
    charts: Sequence[Chart],
    generation: Generation,
    words: str,
    behind: Objectives | None = None,
) -> None:
    """Draw a generation or step at the current time with its text, and record its numbers; see ``Scatter``."""
    scene, chosen = scatter.scene, generation.chosen
    scatter.log_generation(stream, generation, behind=behind)
    if generation.hypervolume is not None:
        stream.log("search/hypervolume", rr.Scalars(generation.hypervolume))
    stream.log("search/counts", rr.Scalars([float(generation.count), float(generation.failed)]))
    series = {"best": scene.best(generation.front) if len(generation.front) else None, "chosen": chosen}
    for kind, values in series.items():
        for name, value in zip(entity_names(scene.names), [] if values is None else values, strict=values is not None):
            stream.log(["search", kind, name], rr.Scalars(float(value)))
    log_text(stream, words)
    for chart in charts:
        chart.log_cursor(stream, float(generation.number))

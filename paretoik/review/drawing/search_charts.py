"""The course of a search over its generations or steps: charts at its end, time series while it runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.arrays import Objectives, Series, Times
from paretoik.review.drawing.axes import Canvas, ParallelAxes, screen_text
from paretoik.review.drawing.charts import Chart, fit_below_tabs
from paretoik.review.drawing.front_panels import outside_panels
from paretoik.review.drawing.layout import TEXT_ENTITY as TEXT
from paretoik.review.drawing.layout import note_view
from paretoik.review.drawing.motion import MotionScene
from paretoik.review.drawing.scatter import SearchScene
from paretoik.review.palette import MARKS, SCREEN, VIEWS, Colour
from paretoik.review.recording.messages import Workcell
from paretoik.review.recording.recorder import Generation, SearchedFront, SearchEnd

# The legend of a recording.


Entry = tuple[str, Colour]
RESOLUTION_ENTRIES: tuple[Entry, ...] = (
    ("step damped, shortened, held, limited or missed", SCREEN.event),
    ("error from which the path counts as lost: dashed", SCREEN.limit),
)


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
    return entries + motion_entries(motions, arm, postures=postures)


def plan_entries(motions: MotionScene | None, *, optima: int = 2, feasible: bool = True) -> list[Entry]:
    """Return the names and colours in a plan's drawing, with or without a feasible motion.

    If there are several ``optima``, one is looked at; a single one is the best.
    """
    entries: list[Entry] = [
        ("start", SCREEN.population),
        ("start beyond the axes: a dash at their edge", SCREEN.population),
        ("what it led to", SCREEN.front),
        ("start that led to no optimum", SCREEN.failed),
        ("best, of a level or in the end", SCREEN.chosen),
        *([("optimum looked at", SCREEN.arm)] if optima > 1 else []),
        ("values of the optima", SCREEN.final),
    ]
    if not feasible:
        entries = [entries[0], entries[1], entries[3]]  # nothing led anywhere
    arm = "arm" if feasible else "arm of the least-violating motion"
    arms = [] if motions is None else [*motion_entries(motions, arm), ("arm of the start looked at", SCREEN.end(0))]
    return entries + arms


def resolution_entries(motions: MotionScene, first: str, others: Sequence[str]) -> list[Entry]:
    """Return the names and colours in a drawing of resolved motions; the ``first`` one is solid."""
    named: list[Entry] = [(first, SCREEN.arm)] if others else []
    named += [(name, SCREEN.end(axis)) for axis, name in enumerate(others)]
    arm = f"arm of {first}, or of the motion looked at" if others else "arm"
    return [*named, *RESOLUTION_ENTRIES, *motion_entries(motions, arm)]


def maxima_entries(cell: Workcell, word: str) -> list[Entry]:
    """Return the names and colours in a drawing of directional maxima."""
    entries: list[Entry] = [
        (f"highest {word}s so far", SCREEN.front),
        ("this direction", SCREEN.chosen),
        ("all directions", SCREEN.final),
        ("arm in the posture of this direction", SCREEN.arm),
        ("postures of those before", SCREEN.ghost),
        ("position of the tool", SCREEN.target),
        ("what motors allow: dashed", SCREEN.text),
    ]
    entries += [("limits: dashed", SCREEN.text)] if "position" in cell.bounds else []
    return entries + ([("obstacle", SCREEN.obstacle)] if cell.obstacles else [])


def motion_entries(motions: MotionScene, arm: str = "arm", *, postures: str = "") -> list[Entry]:
    """Return the names and colours in a drawing of motions; ``arm``: name of the solid arm.

    ``postures``: name of those drawn behind arms that stand still, "" for none.
    """
    cell = motions.workcell
    entries: list[Entry] = [(arm, SCREEN.arm)]
    if cell.link_radius:
        entries.append(("its links", SCREEN.body if cell.arm.is_planar else (*SCREEN.hull[:3], 255)))
    if any(point.motion is not None and not point.motion.is_standing for point in motions.points):
        entries += [("its postures over time", SCREEN.ghost), ("path of its tool", SCREEN.path)]
    elif postures:
        entries.append((postures, SCREEN.ghost))
    if cell.paths:
        entries.append(("path to follow", SCREEN.target))
    if cell.places:
        entries.append(("places that count" if len(cell.places) > 1 else next(iter(cell.places)), SCREEN.target))
    if len(cell.directions):
        entries.append(("directions", SCREEN.target))
    if cell.obstacles:
        entries.append(("obstacle", SCREEN.obstacle))
    if any(chart.limits for chart in motions.charts.values()):
        entries.append(("limits: dashed", SCREEN.text))
    return entries


def choice_entries(names: Sequence[str], motions: MotionScene | None, *, predicts: bool = False) -> list[Entry]:
    """Return the names and colours in a drawing of one or two choices, and of predictions if there are any."""
    colours = (SCREEN.chosen, SCREEN.compared)
    marked: list[Entry] = [(name, colour) for name, colour in zip(names, colours, strict=False)]
    marked += [("predicted, not certified", SCREEN.predicted)] if predicts else []
    return [("front", SCREEN.front), *marked, *([] if motions is None else motion_entries(motions))]


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
class RecordedSearch:
    """All ``generations`` of a search, or steps of a closed loop, and its ``end``; ``note``: what was left out."""

    scene: SearchScene
    recorded: SearchedFront
    generations: Sequence[Generation]
    end: SearchEnd
    note: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class FrontViews:
    """The views of a search's fronts, on axes that contain all of ``shown``, its charts, and its ``note``."""

    search: RecordedSearch
    shown: Objectives
    note: str

    def log(self, stream: rr.RecordingStream, *, static: bool = True) -> None:
        """Draw axes, for all times (static) or from the current one on, and charts and the note, for all times."""
        self.search.scene.log_axes(stream, self.canvases, static=static)
        if self.parallel is not None:
            self.parallel.log(stream, static=static)
        for chart in self._charts:
            chart.log(stream)
        if self.note:
            stream.log("notes/left_out", rr.TextDocument(self.note), static=True)

    def log_generation(self, stream: rr.RecordingStream, generation: Generation, words: str) -> None:
        """Draw a generation or step at the current time, with its text."""
        final = None if self.search.end.front is None else self.search.end.front.objectives
        behind = None if self.search.scene.timeline == "step" else final
        self.search.scene.log_generation(stream, generation, self.canvases, self.parallel, behind=behind)
        log_series(self.search.scene, stream, generation)
        stream.log(TEXT, rr.TextDocument(words, media_type="text/markdown"))
        self.log_cursors(stream, generation.number)

    def log_note(self, stream: rr.RecordingStream, words: str) -> None:
        """Explain in the panels why they have no points, at the current time; without words, stop."""
        self.search.scene.log_note(stream, self.canvases, words)

    def log_cursors(self, stream: rr.RecordingStream, number: int) -> None:
        """Draw the cursors of charts at a generation or step, at the current time."""
        for chart in self._charts:
            chart.log_cursor(stream, float(number))

    def outside(self, generation: Generation) -> int:
        """Return how many individuals of a generation are outside the axes of at least one panel."""
        return outside_panels(self.search.scene.panels.pairs, self.canvases, generation.population)

    @property
    def front(self) -> rrb.View | None:
        """The view of all pairs of objectives; None if nothing finite is shown."""
        return self.search.scene.view() if self.canvases else None

    @property
    def charts(self) -> list[rrb.View]:
        """The views below the front."""
        parallel = [] if self.parallel is None else [self.parallel.view()]
        return [*parallel, *(chart.view() for chart in self._charts)]

    @property
    def notes(self) -> list[rrb.View]:
        """The view of the note, if there is one."""
        return [note_view()] if self.note else []

    @cached_property
    def canvases(self) -> list[Canvas]:
        """The axes of every pair of objectives."""
        return self.search.scene.canvases(self.shown)

    @cached_property
    def parallel(self) -> ParallelAxes | None:
        """The axes of parallel coordinates, for three or more objectives."""
        return self.search.scene.parallel_axes(self.shown)

    @cached_property
    def _charts(self) -> list[Chart]:
        names_before = [] if self.parallel is None else [str(self.parallel.view().name)]
        return fit_below_tabs(search_charts(self.search.scene, self.search.generations), names_before)

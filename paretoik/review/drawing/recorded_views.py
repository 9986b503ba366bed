"""A recording that is there already: its identity, entities, timelines and views, to be shown beside a choice."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import pyarrow
import rerun as rr
import rerun.blueprint as rrb

from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import Timeline
from paretoik.review.drawing.legend import Legend
from paretoik.review.drawing.legend_entries import search_entries
from paretoik.review.drawing.motion_scene import MotionScene
from paretoik.review.drawing.recording_layout import Layout, text_view
from paretoik.review.drawing.search_scene import SearchScene
from paretoik.review.palette import SCREEN

ROOTS: tuple[Literal["choice", "compared"], ...] = ("choice", "compared")  # of what was chosen since
OF_RERUN = ("log_time", "log_tick")  # timelines that it adds itself
ORIGIN, NAME, BOUNDS = "ViewBlueprint:space_origin", "ViewBlueprint:display_name", "VisualBounds2D:range"
ROW = "rerun.controls.RowId"  # grows with time


@dataclass(frozen=True, kw_only=True)
class RecordedView:
    """A flat view of a recording's layout: its origin, its name, and the ends of its axes [pixels]."""

    origin: str
    name: str
    x_range: tuple[float, float]
    y_range: tuple[float, float]

    def view(self) -> rrb.View:
        """Return the view as it was."""
        bounds = rrb.VisualBounds2D(x_range=self.x_range, y_range=self.y_range)
        return rrb.Spatial2DView(origin=self.origin, name=self.name, visual_bounds=bounds, background=SCREEN.background)


@dataclass(frozen=True, kw_only=True)
class RecordedRun:
    """A recording: application, identity, entities, timelines, each of which counts or measures time, and flat views.

    The ``views`` are those of the layout that it had before anything was chosen, in their order.
    """

    application: str
    identity: str
    entities: frozenset[str]
    timelines: dict[str, Literal["sequence", "duration"]]
    views: tuple[RecordedView, ...]

    @property
    def timeline(self) -> Timeline:
        """The timeline of the run itself."""
        timelines: list[Timeline] = [name for name in get_args(Timeline) if name in self.timelines]
        return timelines[0] if timelines else "generation"

    def views_below(self, *roots: str) -> list[rrb.View]:
        """Return the views whose origins begin with one of ``roots``: charts as large as they were drawn."""
        return [each.view() for each in self.views if each.origin.strip("/").split("/")[0] in roots]


def read_recorded(file: Path) -> RecordedRun:
    """Return what a recording has but for choices made since; raises InvalidInput where it cannot be read."""
    entities: set[str] = set()
    timelines: dict[str, Literal["sequence", "duration"]] = {}
    try:
        reader = rr.chunk.RrdReader(file)
        (store,) = reader.recordings()
        for chunk in reader.stream(store=store).drop(content=[f"/{root}/**" for root in ROOTS]):
            entities.add(str(chunk.entity_path))
            for name in sorted(set(chunk.timeline_names) - timelines.keys() - set(OF_RERUN)):
                kind = chunk.to_record_batch().schema.field(name).type
                timelines[name] = "sequence" if pyarrow.types.is_integer(kind) else "duration"
        views = [view for layout in layouts_without_choice(reader)[:1] for view in _flat_views(reader, layout)]
    except (OSError, RuntimeError, ValueError) as fault:
        cause = (str(fault).splitlines() or [type(fault).__name__])[0]
        raise InvalidInput(f"{file}: wanted a recording of a run, got {cause}") from fault
    return RecordedRun(
        application=store.application_id,
        identity=store.recording_id,
        entities=frozenset(entities),
        timelines=timelines,
        views=tuple(views),
    )


def layouts_without_choice(reader: rr.chunk.RrdReader) -> list[rr.chunk.StoreEntry]:
    """Return the layouts of a recording that have no view of a choice."""
    return [layout for layout in reader.blueprints() if not _shows_choice(reader, layout)]


def recorded_tab(scene: SearchScene, motions: MotionScene | None, recorded: RecordedRun) -> rrb.Container:
    """Return the views of a finished search that was recorded, as one tab."""
    entities, timeline = recorded.entities, recorded.timeline
    scene = replace(scene, root=(), timeline=timeline)
    motions = None if motions is None else replace(motions, root="")
    front = any(path.startswith("/front/") for path in entities)
    arm = motions is not None and any(path.startswith("/arm/chosen/") for path in entities)
    walked = any(path.endswith("/looked_at") for path in entities)
    return Layout(
        legend=Legend(entity="legend", entries=search_entries(scene, motions, walked=walked)),
        front=scene.view() if front else None,
        charts=recorded.views_below("parallel", "charts"),
        arm=motions.view() if motions is not None and arm else None,
        joints=recorded.views_below("joint_charts", "postures") if arm else [],
        texts=[text_view(timeline)] if "/text" in entities else [],
        timeline=timeline,
        name="search",
    ).body()


def _shows_choice(reader: rr.chunk.RrdReader, layout: rr.chunk.StoreEntry) -> bool:
    """Say whether a layout has a view of a choice."""
    origins = [part[ORIGIN][0] for part in _parts(reader, layout).values() if part.get(ORIGIN)]
    return any(origin.strip("/").split("/")[0] in ROOTS for origin in origins)


def _flat_views(reader: rr.chunk.RrdReader, layout: rr.chunk.StoreEntry) -> list[RecordedView]:
    """Return the flat views of a layout, in the order in which they were logged, which is that of tabs."""
    parts = _parts(reader, layout)
    views = [(part[ROW], part, parts.get(f"{path}/VisualBounds2D", {})) for path, part in parts.items()]
    return [
        RecordedView(
            origin=part[ORIGIN][0],
            name=part[NAME][0],
            x_range=tuple(bounds[BOUNDS][0]["x_range"]),
            y_range=tuple(bounds[BOUNDS][0]["y_range"]),
        )
        for _, part, bounds in sorted(views, key=lambda view: view[0])
        if part.get(ORIGIN) and part.get(NAME) and bounds.get(BOUNDS)
    ]


def _parts(reader: rr.chunk.RrdReader, layout: rr.chunk.StoreEntry) -> dict[str, dict[str, Any]]:
    """Return row, origin, name and bounds of each entity of a layout that has them, as they stand at its end."""
    parts: dict[str, dict[str, Any]] = {}
    for chunk in reader.stream(store=layout):
        batch = chunk.to_record_batch()
        names = [name for name in (ROW, ORIGIN, NAME, BOUNDS) if name in batch.schema.names]
        part = {name: batch.column(name).to_pylist()[-1] for name in names}
        parts.setdefault(str(chunk.entity_path), {}).update(part)
    return parts

"""A recording that is there already: its identity, entities and timelines, and the views of these."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

import pyarrow
import rerun as rr
import rerun.blueprint as rrb

from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import Timeline
from paretoik.review.drawing.drawn_axes import TEXT
from paretoik.review.drawing.legend import Legend
from paretoik.review.drawing.legend_entries import search_entries
from paretoik.review.drawing.motion_scene import MotionScene
from paretoik.review.drawing.recording_layout import Layout, text_view
from paretoik.review.drawing.search_scene import SearchScene
from paretoik.review.drawing.view_tabs import nested_tabs
from paretoik.review.drawing_options import VIEWS
from paretoik.review.palette import SCREEN

ROOTS: tuple[Literal["choice", "compared"], ...] = ("choice", "compared")  # of what was chosen since
OF_RERUN = ("log_time", "log_tick")  # timelines that it adds itself


@dataclass(frozen=True, kw_only=True)
class RecordedRun:
    """A recording: application, identity, entities, and its timelines, each of which counts or measures time."""

    application: str
    identity: str
    entities: frozenset[str]
    timelines: dict[str, Literal["sequence", "duration"]]

    @property
    def timeline(self) -> Timeline:
        """The timeline of the run itself."""
        timelines: list[Timeline] = [name for name in get_args(Timeline) if name in self.timelines]
        return timelines[0] if timelines else "generation"


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
    except (OSError, RuntimeError, ValueError) as fault:
        cause = (str(fault).splitlines() or [type(fault).__name__])[0]
        raise InvalidInput(f"{file}: wanted a recording of a run, got {cause}") from fault
    return RecordedRun(
        application=store.application_id,
        identity=store.recording_id,
        entities=frozenset(entities),
        timelines=timelines,
    )


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
        charts=_chart_views(("parallel", "charts"), entities),
        arm=motions.view() if motions is not None and arm else None,
        joints=_chart_views(("joint_charts", "postures"), entities) if arm else [],
        texts=[text_view(timeline)] if "/text" in entities else [],
        timeline=timeline,
        name="search",
    ).body()


def _chart_views(roots: Sequence[str], entities: Collection[str]) -> list[rrb.View]:
    """Return a view a chart below entities, or of an entity itself where it has axes, as tabs of one column."""
    paths = [entity for root in roots for entity in _charts_below(root, entities)]
    names = [" ".join(entity[-1].split("_")) for entity in paths]
    nested = nested_tabs(names, VIEWS.panels[0])
    return [
        _chart_view("/".join(entity), name, inner) for entity, name, inner in zip(paths, names, nested, strict=True)
    ]


def _charts_below(root: str, entities: Collection[str]) -> list[tuple[str, ...]]:
    """Return the parts of the paths of charts."""
    parts = [path.split("/")[1:] for path in sorted(entities)]
    below = {tuple(each[:2]) for each in parts if each[0] == root and each[-1] == "grid" and len(each) == 3}
    itself = {(root,) for each in parts if each[0] == root and not below}
    return sorted(below | itself)


def _chart_view(origin: str, name: str, nested: bool) -> rrb.View:
    """Return the view of a chart, one that is a tab of a tab lower by the second row of names."""
    bottom = VIEWS.chart[1] - TEXT.top - (VIEWS.title if nested else 0.0)
    bounds = rrb.VisualBounds2D(x_range=[-TEXT.left, VIEWS.chart[0] - TEXT.left], y_range=[-TEXT.top, bottom])
    return rrb.Spatial2DView(origin=origin, name=name, visual_bounds=bounds, background=SCREEN.background)

"""A recording that is there already: its identity, entities, timelines and layout, to be shown beside a choice."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args
from uuid import UUID

import numpy as np
import pyarrow
import rerun as rr
import rerun.blueprint as rrb

from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import Timeline

ROOTS: tuple[Literal["choice", "compared"], ...] = ("choice", "compared")  # of what was chosen since
OF_RERUN = ("log_time", "log_tick")  # timelines that it adds itself
ORIGIN, VIEWPORT_ROOT = "ViewBlueprint:space_origin", "ViewportBlueprint:root_container"
VIEWS_OF_LAYOUTS = ("/container/**", "/view/**")  # entities of layouts, without panels


@dataclass(frozen=True, kw_only=True)
class RecordedTimeline:
    """A timeline that counts or measures time, from its ``begin`` on, a number or nanoseconds."""

    kind: Literal["sequence", "duration"]
    begin: int

    @property
    def first(self) -> dict[str, Any]:
        """The first instant, as ``set_time`` takes it."""
        return {self.kind: self.begin if self.kind == "sequence" else np.timedelta64(self.begin, "ns")}


class RecordedTab(rrb.Container):
    """The views of a recording's layout as they were drawn, with all names and sizes, below their ``root``."""

    def __init__(self, root: UUID, chunks: Iterable[rr.chunk.Chunk]) -> None:
        super().__init__(kind=rrb.components.ContainerKind.Vertical, name=None)
        self.id = root
        self._chunks = chunks

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        stream.send_chunks(self._chunks)


@dataclass(frozen=True, kw_only=True)
class RecordedRun:
    """A recording: application, identity, entities, timelines by name, and its layout.

    The layout is that which it had before anything was chosen: a ``root`` container, None where it had no layout, and
    the ``chunks`` of its containers and views.
    """

    application: str
    identity: str
    entities: frozenset[str]
    timelines: dict[str, RecordedTimeline]
    root: UUID | None
    chunks: tuple[rr.chunk.Chunk, ...] = field(compare=False, repr=False)

    @property
    def timeline(self) -> Timeline:
        """The timeline of the run itself."""
        timelines: list[Timeline] = [name for name in get_args(Timeline) if name in self.timelines]
        return timelines[0] if timelines else "generation"

    def tab(self) -> RecordedTab | None:
        """Return the views of the run as one tab; None where it had no layout."""
        return None if self.root is None else RecordedTab(self.root, self.chunks)


def read_recorded(file: Path) -> RecordedRun:
    """Return what a recording has but for choices made since; raises InvalidInput where it cannot be read."""
    entities: set[str] = set()
    timelines: dict[str, RecordedTimeline] = {}
    try:
        reader = rr.chunk.RrdReader(file)
        (store,) = reader.recordings()
        for chunk in reader.stream(store=store).drop(content=[f"/{root}/**" for root in ROOTS]):
            entities.add(str(chunk.entity_path))
            timelines |= _timelines(chunk, timelines)
        root, chunks = _layout(reader)
    except (OSError, RuntimeError, ValueError) as fault:
        cause = (str(fault).splitlines() or [type(fault).__name__])[0]
        raise InvalidInput(f"{file}: wanted a recording of a run, got {cause}") from fault
    return RecordedRun(
        application=store.application_id,
        identity=store.recording_id,
        entities=frozenset(entities),
        timelines=timelines,
        root=root,
        chunks=chunks,
    )


def layouts_without_choice(reader: rr.chunk.RrdReader) -> list[rr.chunk.StoreEntry]:
    """Return the layouts of a recording that have no view of a choice."""
    return [layout for layout in reader.blueprints() if not _shows_choice(reader, layout)]


def _timelines(chunk: rr.chunk.Chunk, former: dict[str, RecordedTimeline]) -> dict[str, RecordedTimeline]:
    """Return the timelines of a chunk, from where they begin in it or before."""
    names = [name for name in chunk.timeline_names if name not in OF_RERUN]
    if not names or chunk.is_empty:
        return {}
    batch, timelines = chunk.to_record_batch(), dict[str, RecordedTimeline]()
    for name in names:
        column = batch.column(name)
        begin = int(column.cast("int64").to_numpy().min())
        begin = min(begin, former[name].begin) if name in former else begin
        kind: Literal["sequence", "duration"] = "sequence" if pyarrow.types.is_integer(column.type) else "duration"
        timelines[name] = RecordedTimeline(kind=kind, begin=begin)
    return timelines


def _layout(reader: rr.chunk.RrdReader) -> tuple[UUID | None, tuple[rr.chunk.Chunk, ...]]:
    """Return the root container of the layout before anything was chosen, and the chunks of its parts."""
    for layout in layouts_without_choice(reader)[:1]:
        roots = _values(reader.stream(store=layout), VIEWPORT_ROOT)
        chunks = tuple(reader.stream(store=layout).filter(content=VIEWS_OF_LAYOUTS).to_chunks())
        return (UUID(bytes=bytes(roots[-1])) if roots else None), chunks
    return None, ()


def _shows_choice(reader: rr.chunk.RrdReader, layout: rr.chunk.StoreEntry) -> bool:
    """Say whether a layout has a view of a choice."""
    return any(origin.strip("/").split("/")[0] in ROOTS for origin in _values(reader.stream(store=layout), ORIGIN))


def _values(chunks: Iterable[rr.chunk.Chunk], component: str) -> list[Any]:
    """Return all values of a component of a layout, in the order in which they stand there."""
    batches = (chunk.to_record_batch() for chunk in chunks)
    columns = [batch.column(component).to_pylist() for batch in batches if component in batch.schema.names]
    return [value for column in columns for row in column for value in row or ()]

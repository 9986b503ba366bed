"""Reads the contents of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from paretoik.review.drawing.axes import TEXT, Canvas
from paretoik.review.drawing.choice_layer import ROOTS

TIMELINES = (
    *("generation", "motion", "replay", "point", "step", "individual", "level", "refinement"),
    *("start", "optimum", "solution", "direction"),
)
SECOND = 1_000_000_000  # durations are nanoseconds
FRAME = ("/grid", "/labels", "/axes/lines")  # of charts: on their own they are not a picture


def drawn_labels(canvas: Canvas) -> tuple[list[str], np.ndarray]:
    """Return the words of an axis's ticks and labels, and their middles [pixels]."""
    stream = Drawn()
    canvas.log(stream, "canvas")
    (label,) = stream.drawn["canvas/labels"]
    places = np.array(label.positions.as_arrow_array().to_pylist()).reshape(-1, 2) + np.array([0.0, TEXT.drop])
    return label.labels.as_arrow_array().to_pylist(), places


class Drawn(rr.RecordingStream):
    """Keeps what is drawn, by entity."""

    def __init__(self) -> None:
        super().__init__("drawn")
        self.drawn: dict[str, Any] = {}

    def log(self, entity: str, *drawings: Any, static: bool = False) -> None:
        self.drawn[entity] = drawings


def read(file: Path) -> dict[str, list]:
    """Return the record batches of each entity of the data recording, without the blueprint."""
    reader = rr.chunk.RrdReader(file)
    (store,) = reader.recordings()
    batches: dict[str, list] = {}
    for chunk in reader.stream(store=store):
        batches.setdefault(str(chunk.entity_path), []).append(chunk.to_record_batch())
    return batches


def rows(batches: list, timeline: str, component: str) -> dict[int, np.ndarray]:
    """Return ``component`` of the last row logged at each time of `timeline`; ids of rows give their order."""
    last_values: dict[int, tuple[bytes, np.ndarray]] = {}
    for batch in batches:
        names = batch.schema.names
        matching = [name for name in names if name.split(":")[-1] == component]
        if timeline in names and matching:
            ids = batch.column("rerun.controls.RowId").to_pylist()
            times = batch.column(timeline).cast("int64").to_pylist()
            for row, time, value in zip(ids, times, batch.column(matching[0]).to_pylist(), strict=True):
                if value is not None and row >= last_values.get(time, (b"",))[0]:
                    last_values[time] = row, np.array(value)
    return {time: value for time, (_, value) in last_values.items()}


def views(file: Path) -> dict[str, str]:
    """Return the origin of each view of the opening layout, by its name and place."""
    return _views(file, opening_layout(file))


def opening_layout(file: Path) -> int:
    """Return the number of the opening layout among all layouts, whose order says nothing."""
    layouts = [_views(file, number) for number in range(len(rr.chunk.RrdReader(file).blueprints()))]
    # The layout before a choice is also kept.
    of_choice = [number for number, each in enumerate(layouts) if any(map(_of_choice, each.values()))]
    (opening,) = of_choice or range(len(layouts))
    return opening


def _of_choice(origin: str) -> bool:
    return origin.split("/")[1] in ROOTS


def _views(file: Path, number: int) -> dict[str, str]:
    reader = rr.chunk.RrdReader(file)
    layout = reader.blueprints()[number]
    origins = {}
    for chunk in reader.stream(store=layout):
        batch = chunk.to_record_batch()
        if "ViewBlueprint:space_origin" in batch.schema.names:
            (origin,) = batch.column("ViewBlueprint:space_origin").to_pylist()[-1]
            origins[str(chunk.entity_path)] = "/" + origin.strip("/")
    return origins


def shown(entities: dict[str, list], origin: str, timeline: str, time: int) -> list[str]:
    """Return the entities at or below `origin` that show something at a time: static, or logged before."""
    return [
        path
        for path, batches in entities.items()
        if (path == origin or path.startswith(origin + "/")) and any(_lasts(batch, timeline, time) for batch in batches)
    ]


def _lasts(batch, timeline: str, time: int) -> bool:
    times = [name for name in TIMELINES if name in batch.schema.names]
    if not times:
        return True
    return timeline in times and min(batch.column(timeline).cast("int64").to_pylist()) <= time


def first_instants(file: Path) -> dict[str, int]:
    """Return the first time with data in a recording, by timeline."""
    batches = [batch for each in read(file).values() for batch in each]
    times = [
        (name, min(batch.column(name).cast("int64").to_pylist()))
        for batch in batches
        for name in TIMELINES
        if name in batch.schema.names
    ]
    return {name: min(time for each, time in times if each == name) for name, _ in times}


def blank_views(file: Path, instants: dict[str, tuple[int, ...]]) -> list[tuple[str, str, int]]:
    """Return view, timeline and time of every view that only shows axes at one of the instants."""
    entities = read(file)
    return [
        (view, timeline, time)
        for timeline, times in instants.items()
        for time in times
        for view, origin in views(file).items()
        if not [path for path in shown(entities, origin, timeline, time) if not path.endswith(FRAME)]
    ]


def missing_entities(file: Path, wanted: list[str], instants: dict[str, tuple[int, ...]]) -> list[tuple[str, str, int]]:
    """Return entity, timeline and time of everything in ``wanted`` that is missing at one of the instants."""
    entities = read(file)
    return [
        (path, timeline, time)
        for timeline, times in instants.items()
        for time in times
        for path in wanted
        if not shown(entities, path, timeline, time)
    ]


def static_words(batches: list) -> list[str]:
    """Return the labels of an entity that never changes."""
    return static_values(batches, "labels")


def static_values(batches: list, component: str) -> list:
    """Return a component of an entity that never changes."""
    (column,) = [name for name in batches[-1].schema.names if name.endswith(f":{component}")]
    return batches[-1].column(column).to_pylist()[-1]


def last_text(batches: list, timeline: str, time: int) -> str:
    """Return the text at a time of a timeline."""
    words = rows(batches, timeline, "text")
    return str(words[max(each for each in words if each <= time)][0])


def check_broken_limits(words: str, problem: Any, motion: Any) -> None:
    """Check that a text names all limits that a motion breaks, with amounts, and joints faster than 1 rad/s."""
    for name, violation in zip(problem.task.limit_names, problem.task.violations(motion), strict=True):
        assert (f"- {name}: violated by {violation:.3g} of its range" in words) == (violation > 0)
    for joint, speed in zip(problem.task.arm.joint_names, np.abs(motion.dq).max(axis=0), strict=True):
        assert (f"**{joint}, velocity**: reaches" in words) == (speed > 1.0 + 1e-6)

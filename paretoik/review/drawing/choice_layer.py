"""A chosen motion, or two to compare, as a layer over the recording of a run.

The layer has its own layout, in which the recording's views are a second tab.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from threading import Thread
from typing import Any, Literal, get_args
from uuid import UUID

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.error_utils import RerunWarning

from paretoik.arrays import Times
from paretoik.errors import InvalidInput, ParetoikError, warn_user
from paretoik.formulations.protocol import Timeline, is_loop
from paretoik.front.choice import Choice, Prediction
from paretoik.front.choice_tree import chosen
from paretoik.front.front import Front
from paretoik.review.drawing.front_panels import LAYERS
from paretoik.review.drawing.layout import Entry, Legend, choice_blueprint, log_text
from paretoik.review.drawing.motion import NO_TIMES, MotionScene, is_moving, motion_views
from paretoik.review.drawing.point_text import choice_text
from paretoik.review.drawing.scatter import Scatter, SearchScene
from paretoik.review.palette import SCREEN, VIEWS
from paretoik.review.recording.messages import RecordedPoint, chosen_point, record_motion, workcell_of_front
from paretoik.runs.file_replacement import only_writer, replace_file
from paretoik.runs.files import RECORDING, read_plain_file
from paretoik.runs.folder import check_no_run

# An existing recording: its identity, entities, timelines and layout, to be shown next to a choice.


ROOTS: tuple[Literal["choice", "compared"], ...] = ("choice", "compared")  # entities of later choices
OF_RERUN = ("log_time", "log_tick")  # timelines that Rerun adds itself
ORIGIN, VIEWPORT_ROOT = "ViewBlueprint:space_origin", "ViewportBlueprint:root_container"
VIEWS_OF_LAYOUTS = ("/container/**", "/view/**")  # entities of layouts, without panels


class RecordedTab(rrb.Container):
    """The views of a recording's layout as drawn, with all names and sizes, below their ``root``."""

    def __init__(self, root: UUID, chunks: Iterable[rr.chunk.Chunk]) -> None:
        super().__init__(kind=rrb.components.ContainerKind.Vertical, name=None)
        self.id = root
        self._chunks = chunks

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        stream.send_chunks(self._chunks)


@dataclass(frozen=True, kw_only=True)
class RecordedRun:
    """A recording: application, identity, entities, the first instant of each timeline, and its layout.

    Instants are as ``set_time`` takes them. The layout is the one before any choice: a ``root`` container, None if
    there was no layout, and the ``chunks`` of its containers and views.
    """

    application: str
    identity: str
    entities: frozenset[str]
    timelines: dict[str, dict[str, Any]]
    root: UUID | None
    chunks: tuple[rr.chunk.Chunk, ...] = field(compare=False, repr=False)

    @property
    def timeline(self) -> Timeline:
        """The timeline of the run itself."""
        timelines: list[Timeline] = [name for name in get_args(Timeline) if name in self.timelines]
        return timelines[0] if timelines else "generation"

    def tab(self) -> RecordedTab | None:
        """Return the views of the run as one tab; None if it had no layout."""
        return None if self.root is None else RecordedTab(self.root, self.chunks)


def read_recorded(file: Path) -> RecordedRun:
    """Return a recording without later choices; raises InvalidInput if it cannot be read."""
    entities: set[str] = set()
    begins: dict[str, Any] = {}  # numbers, or durations
    roots, layout = list[Any](), list[rr.chunk.Chunk]()
    try:
        reader = rr.chunk.RrdReader(file)
        (store,) = reader.recordings()
        for chunk in reader.stream(store=store).drop(content=[f"/{root}/**" for root in ROOTS]):
            entities.add(str(chunk.entity_path))
            if not chunk.is_empty:
                batch = chunk.to_record_batch()
                for name in (name for name in chunk.timeline_names if name not in OF_RERUN):
                    begin = batch.column(name).to_numpy(zero_copy_only=False).min()
                    begins[name] = min(begin, begins.get(name, begin))
        for store_of_layout in layouts_without_choice(reader)[:1]:
            roots = _values(reader.stream(store=store_of_layout), VIEWPORT_ROOT)
            layout = reader.stream(store=store_of_layout).filter(content=VIEWS_OF_LAYOUTS).to_chunks()
    except (OSError, RuntimeError, ValueError) as fault:
        cause = (str(fault).splitlines() or [type(fault).__name__])[0]
        raise InvalidInput(f"{file}: must be a recording of a run, got {cause}") from fault
    return RecordedRun(
        application=store.application_id,
        identity=store.recording_id,
        entities=frozenset(entities),
        timelines={
            name: {"duration" if isinstance(begin, np.timedelta64) else "sequence": begin}
            for name, begin in begins.items()
        },
        root=UUID(bytes=bytes(roots[-1])) if roots else None,
        chunks=tuple(layout),
    )


def layouts_without_choice(reader: rr.chunk.RrdReader) -> list[rr.chunk.StoreEntry]:
    """Return the layouts of a recording that have no view of a choice."""

    def roots(layout: rr.chunk.StoreEntry) -> set[str]:
        """Return the first parts of the entities that a layout shows."""
        return {origin.strip("/").split("/")[0] for origin in _values(reader.stream(store=layout), ORIGIN)}

    return [layout for layout in reader.blueprints() if roots(layout).isdisjoint(ROOTS)]


def _values(chunks: Iterable[rr.chunk.Chunk], component: str) -> list[Any]:
    """Return all values of a component of a layout, in their order."""
    batches = (chunk.to_record_batch() for chunk in chunks)
    columns = [batch.column(component).to_pylist() for batch in batches if component in batch.schema.names]
    return [value for column in columns for row in column for value in row or ()]


# A chosen motion as a layer over a recording.


@dataclass(frozen=True, kw_only=True, eq=False)
class ChoiceLayer:
    """One choice of a front, or two, with their motions on the timeline ``motion``.

    On all other timelines of the ``recorded`` run, if there is one, the arms stand still. ``names``: names of the
    choices, by default points with their ids. Axes also contain the motions of points ``around`` them. ``width``: width
    of the viewer [pixels]. If it ``predicts``, the legend explains how predictions are drawn.
    """

    front: Front
    choices: tuple[Choice, ...]
    recorded: RecordedRun | None = None
    names: tuple[str, ...] = ()
    around: tuple[RecordedPoint, ...] = ()
    width: float = VIEWS.width
    predicts: bool = False

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw the front with the choices, their texts, and their arms."""
        self.log_front(stream)
        self.log_choices(stream)

    def log_front(self, stream: rr.RecordingStream) -> None:
        """Draw the front on its axes, for all times."""
        self._legend.log(stream)
        self._scatter.log_axes(stream)
        front, parallel = self.front, self._scatter.parallel
        names = [f"point {number}" for number in front.ids]
        self._scatter.log_points(stream, "front", front.objectives, ids=front.ids, names=names, static=True)
        if parallel is not None:
            lines = parallel.lines(front.objectives, SCREEN.front, 0.6, 1.0)
            stream.log(f"{parallel.entity}/front", lines, static=True)

    def log_choices(self, stream: rr.RecordingStream, times: Times = NO_TIMES) -> None:
        """Draw the choices, for all times, and their arms along their motions, also at ``times``.

        A later call for other choices of the layer replaces what an earlier call drew.
        """
        scatter, front = self._scatter, self.front
        for root, choice, point, motions in zip(ROOTS, self.choices, self._points, self._motions, strict=False):
            F, name = choice.objectives[None], f"point {choice.id}"
            scatter.log_points(stream, root, F, ids=np.array([choice.id]), names=[name], static=True)
            scatter.log_label(stream, root, F, name, avoided=front.objectives, static=True)
            if scatter.parallel is not None:
                lines = scatter.parallel.lines(F, LAYERS[root][0], 2.2, 4.0)
                stream.log(f"{scatter.parallel.entity}/{root}", lines, static=True)
            words = choice_text(front, choice, title="chosen" if root == ROOTS[0] else "compared")
            log_text(stream, words, f"{root}/text", static=True)
            if motions is not None and point.motion is not None:
                self._log_motion(stream, motions, point, times)

    def log_prediction(self, stream: rr.RecordingStream, prediction: Prediction | None) -> None:
        """Draw the expected result of a move, for all times, in grey; None removes it."""
        F = np.zeros((0, len(self.front.names))) if prediction is None else prediction.objectives[None]
        self._scatter.log_points(stream, "predicted", F, static=True)
        if (parallel := self._scatter.parallel) is not None:
            stream.log(f"{parallel.entity}/predicted", parallel.lines(F, SCREEN.predicted, 2.0, 3.0), static=True)
        if self._motions[0] is not None:
            motion = None if prediction is None else record_motion(prediction.motion, curves=False)
            self._motions[0].log_predicted(stream, motion)

    def _log_motion(self, stream: rr.RecordingStream, motions: MotionScene, point: RecordedPoint, times: Times) -> None:
        """Draw the moving arm of a point; it stands still on the recording's timelines."""
        assert point.motion is not None
        motions.log(stream)
        begins = {} if self.recorded is None else self.recorded.timelines
        for timeline, first in ({self._timeline: {"duration": 0.0}} | begins).items():
            stream.set_time(timeline, **first)
        motions.log_whole(stream, [point])
        stream.reset_time()
        motions.send_motion(stream, point, times)

    def blueprint(self) -> rrb.Blueprint:
        """Return the layout; the views of the recorded run, if any, are a second tab."""
        arms = [motion_views(motions) for motions in self._motions if motions is not None]
        texts = [
            rrb.TextDocumentView(origin=f"{root}/text", name=name)
            for root, name in zip(ROOTS, self._names, strict=False)
        ]
        return choice_blueprint(
            self._legend,
            self._scatter.view(),
            self._scatter.parallel_views(),
            arms,
            texts,
            name=" and ".join(self._names),
            recorded=None if self.recorded is None else self.recorded.tab(),
            narrow=self.width < VIEWS.width,
            timeline=self._timeline,
        )

    @property
    def _timeline(self) -> str:
        """The timeline that plays: the motion's, or the recorded run's if arms stand still."""
        return "motion" if self.recorded is None or is_moving(self._points) else self.recorded.timeline

    @cached_property
    def _scatter(self) -> Scatter:
        names, units, maximised = self.front.names, self.front.units, self.front.maximised
        scene = SearchScene(names=tuple(names), units=tuple(units), maximised=tuple(maximised), root=(ROOTS[0],))
        return Scatter(scene=scene, shown=self.front.objectives)

    @cached_property
    def _points(self) -> list[RecordedPoint]:
        return [chosen_point(choice) for choice in self.choices]

    @cached_property
    def _motions(self) -> list[MotionScene | None]:
        """The arms of the choices on the same axes; None without a workcell or motions."""
        cell = workcell_of_front(self.front)
        if cell is None or any(point.motion is None for point in self._points):
            return [None] * len(self.choices)
        return [
            MotionScene(
                workcell=cell,
                names=tuple(self.front.names),
                points=[*self._points, *self.around],
                title=name,
                root=f"{root}/",
            )
            for root, name, _ in zip(ROOTS, self._names, self.choices, strict=False)
        ]

    @property
    def _legend(self) -> Legend:
        colours = [LAYERS[root][0] for root in ROOTS]
        entries: list[Entry] = [("front", SCREEN.front), *zip(self._names, colours, strict=False)]
        entries += [("predicted, not certified", SCREEN.predicted)] if self.predicts else []
        entries += next((motions.entries() for motions in self._motions if motions is not None), [])
        return Legend(entity=f"{ROOTS[0]}/legend", entries=entries, width=self.width)

    @property
    def _names(self) -> tuple[str, ...]:
        return self.names or tuple(f"point {choice.id}" for choice in self.choices)


# The recording of a run with the choice that was made on its front.
#
# Rerun's output goes through a pipe into memory, because its file sink may hang on a full disk. A new file replaces the
# recording only after it has been read back.


BLOCK = 1 << 20  # bytes read from a pipe at once


class RecordedLayout(rrb.Blueprint):
    """The layout of a recording before any choice, to be written again unchanged."""

    def __init__(self, chunks: rr.chunk.LazyChunkStream) -> None:
        super().__init__()
        self._chunks = chunks

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        stream.send_chunks(self._chunks)


def show_choice_in_recording(front: Front, *, moved: Choice | None = None, source: Path | None = None) -> None:
    """Make the recording in a front's run folder open on the present choice.

    Without a choice it opens as recorded. A point that was ``moved`` to is shown next to the present choice, or without
    it if there is none or if the ``source`` is another run's recording. Nothing is done for a closed loop: its motion
    is already in its recording. A recording that cannot be read or replaced stays unchanged, with a warning: the
    choice, or point, is kept elsewhere.
    """
    if front.folder is None or is_loop(front):
        return
    recording = front.folder / RECORDING
    source = recording if source is None else source
    try:
        with only_writer(front.folder):  # so that the recording shows the last of several choices
            check_no_run(front.folder)
            read_plain_file(source)  # not a link, whose target would stay unchanged
            point = front.choices.chosen
            if point is not None and point.point not in front:  # of a newer front
                return
            recorded = _read_whole(source)
            shown = {each.id: each for each in (chosen(front), moved) if each is not None}
            choice, compare = (*shown.values(), None, None)[:2]
            content = recording_with_choice(front, choice, recording=source, compare=compare)
            replace_file(recording, content, check=lambda file: _check_holds(file, recorded))
    except Exception as fault:  # a view may fail in any way
        cause = str(fault) if isinstance(fault, ParetoikError) else f"{recording}: {type(fault).__name__}: {fault}"
        what = "choice" if moved is None else "point"
        text = f"the recording stays as it was, the {what} is kept: {' '.join(cause.split())}"
        warn_user(text)


def recording_with_choice(
    front: Front, choice: Choice | None, *, recording: Path, compare: Choice | None = None
) -> bytes:
    """Return the content of a recording that opens on a choice, with another one next to it if given.

    It replaces an earlier choice. Without a choice it opens as recorded. Raises InvalidInput if the recording cannot be
    read.
    """
    recorded = read_recorded(recording)
    reader = rr.chunk.RrdReader(recording)
    (store,) = reader.recordings()
    content = bytearray()
    with _stream_into(content, recorded) as stream:
        stream.send_chunks(reader.stream(store=store).drop(content=[f"/{root}/**" for root in ROOTS]))
        for layout in layouts_without_choice(reader)[:1]:
            opens = choice is None
            stream.send_blueprint(RecordedLayout(reader.stream(store=layout)), make_active=opens, make_default=opens)
        if choice is not None:
            choices = (choice,) if compare is None else (choice, compare)
            layer = ChoiceLayer(front=front, choices=choices, recorded=recorded)
            layer.log(stream)
            stream.send_blueprint(layer.blueprint(), make_active=True, make_default=True)
    return bytes(content)


@contextmanager
def _stream_into(content: bytearray, recorded: RecordedRun) -> Iterator[rr.RecordingStream]:
    """Yield a stream of the same recording; ``content`` has all of it at the end."""
    source, sink = os.pipe()

    def drain() -> None:
        while block := os.read(source, BLOCK):
            content.extend(block)

    reader = Thread(target=drain, daemon=True)
    reader.start()
    stream = rr.RecordingStream(recorded.application, recording_id=recorded.identity, send_properties=False)
    try:
        stream.save(f"/dev/fd/{sink}")
        yield stream
        stream.flush()
    finally:
        with suppress(RuntimeError):
            stream.disconnect()
        os.close(sink)
        reader.join()
        os.close(source)


def _read_whole(recording: Path) -> RecordedRun:
    """Return a recording; raises InvalidInput if it was cut off, although some of it is readable."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RerunWarning)
        try:
            return read_recorded(recording)
        except RerunWarning as fault:
            raise InvalidInput(f"{recording}: must be a complete recording, got one that was cut off") from fault


def _check_holds(file: Path, former: RecordedRun) -> None:
    """Raise InvalidInput unless a recording contains everything of the former one."""
    recorded = _read_whole(file)
    if recorded != former:
        missing = sorted(former.entities - recorded.entities)
        raise InvalidInput(f"{file}: must have everything of the former recording, got one without {missing[:1]}")

"""A chosen motion, or two to compare, as a layer over the recording of a run."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
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
from paretoik.inputs import first_line
from paretoik.review.drawing.layout import (
    Entry,
    Layout,
    Legend,
    RecordedLayout,
    column,
    log_text,
    set_times,
    stream_in_memory,
    tabbed,
)
from paretoik.review.drawing.motion import NO_TIMES, MotionScene, is_moving, motion_views
from paretoik.review.drawing.point_text import point_text
from paretoik.review.drawing.scatter import LAYERS, Scatter
from paretoik.review.palette import DRAWING, SCREEN, VIEWS
from paretoik.review.recording.messages import RecordedPoint, Workcell, chosen_point, record_motion, workcell_of
from paretoik.review.recording.recorder import OPTIONS, SearchedFront
from paretoik.runs.file_replacement import only_writer, replace_file
from paretoik.runs.files import RECORDING
from paretoik.runs.folder import check_no_run
from paretoik.task.motion import Motion

# An existing recording: its data, timelines and layout, shown next to a choice.


ROOTS: tuple[Literal["choice", "compared"], ...] = ("choice", "compared")  # entities of choices
OF_RERUN = ("log_time", "log_tick")  # timelines of Rerun's own
ORIGIN, VIEWPORT_ROOT = "ViewBlueprint:space_origin", "ViewportBlueprint:root_container"
VIEWS_OF_LAYOUTS = ("/container/**", "/view/**")  # entities of layouts, without panels


class RecordedTab(rrb.Container):
    """The views of a recording's layout below their ``root``, with unchanged names and sizes."""

    def __init__(self, root: UUID, chunks: Iterable[rr.chunk.Chunk]) -> None:
        super().__init__(kind=rrb.components.ContainerKind.Vertical, name=None)
        self.id = root
        self._chunks = chunks

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        stream.send_chunks(self._chunks)


class RecordedRun:
    """The recording of a run, without its choices. Raises InvalidInput if it cannot be read."""

    def __init__(self, file: Path) -> None:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", RerunWarning)  # if a recording was cut off
                self._reader = rr.chunk.RrdReader(file)
                (self.store,) = self._reader.recordings()
                origins = {each: self._values(each, ORIGIN) for each in self._reader.blueprints()}
        except (OSError, RuntimeError, ValueError, RerunWarning) as fault:
            raise InvalidInput(f"{file}: must be a recording of a run, got {first_line(fault)}") from fault
        roots = {each: {origin.strip("/").split("/")[0] for origin in shown} for each, shown in origins.items()}
        self._layout = next((each for each, names in roots.items() if names.isdisjoint(ROOTS)), None)

    def data(self) -> rr.chunk.LazyChunkStream:
        """Return the recorded data."""
        return self._reader.stream(store=self.store).drop(content=[f"/{root}/**" for root in ROOTS])

    def layout(self) -> RecordedLayout | None:
        """Return the layout, if there is one."""
        return None if self._layout is None else RecordedLayout(self._reader.stream(store=self._layout))

    def tab(self) -> RecordedTab | None:
        """Return the views of the layout as one tab; None if there is no layout."""
        if self._layout is None:
            return None
        root = UUID(bytes=bytes(self._values(self._layout, VIEWPORT_ROOT)[-1]))
        return RecordedTab(root, self._reader.stream(store=self._layout).filter(content=VIEWS_OF_LAYOUTS))

    @cached_property
    def begins(self) -> dict[str, Any]:
        """The first instant of each timeline, as a count or a time difference."""
        begins: dict[str, Any] = {}
        for chunk in self.data():
            for name in set(chunk.timeline_names) - set(OF_RERUN) if not chunk.is_empty else ():
                begin = chunk.to_record_batch().column(name).to_numpy(zero_copy_only=False).min()
                begins[name] = min(begin, begins.get(name, begin))
        return begins

    @property
    def timeline(self) -> Timeline:
        """The timeline of the run itself."""
        timelines: list[Timeline] = [name for name in get_args(Timeline) if name in self.begins]
        return timelines[0] if timelines else "generation"

    def _values(self, layout: rr.chunk.StoreEntry, component: str) -> list[Any]:
        """Return all values of a component of a layout, in their order."""
        batches = [chunk.to_record_batch() for chunk in self._reader.stream(store=layout)]
        columns = [batch.column(component).to_pylist() for batch in batches if component in batch.schema.names]
        return [value for column in columns for row in column for value in row or ()]


@dataclass(frozen=True, kw_only=True, eq=False)
class ChoiceLayer:
    """One choice of a front, or two, with their motions on the timeline ``motion``.

    recorded: recorded run, if any; on its other timelines the arms stand still
    names: names of the choices, by default points with their ids
    around: further points whose motions the axes also contain
    width: width of the viewer [pixels]
    predicts: whether the legend explains how predictions are drawn
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
        names = [f"point {number}" for number in self.front.ids]
        objectives, ids = self.front.objectives, self.front.ids
        self._scatter.log_points(stream, "front", objectives, ids=ids, names=names, static=True)

    def log_choices(self, stream: rr.RecordingStream, times: Times = NO_TIMES) -> None:
        """Draw the choices, for all times, and their arms along their motions, also at ``times``."""
        scatter, front = self._scatter, self.front
        for root, choice, point, motions in zip(ROOTS, self.choices, self._points, self._motions, strict=False):
            F, name = choice.objectives[None], f"point {choice.id}"
            scatter.log_points(stream, root, F, ids=np.array([choice.id]), names=[name], static=True)
            scatter.log_label(stream, root, F, name, avoid=scatter.area(front.objectives), static=True)
            title = "chosen" if root == ROOTS[0] else "compared"
            words = point_text(front, choice.index, chosen=choice, title=title, whole=True)
            log_text(stream, words, f"{root}/text", static=True)
            if motions is not None:  # the arm stands still on the recording's timelines
                motions.log(stream)
                set_times(stream, **({self._timeline: 0.0} | ({} if self.recorded is None else self.recorded.begins)))
                motions.log_whole(stream, [point])
                stream.reset_time()
                motions.send_motion(stream, point, times)

    def log_prediction(self, stream: rr.RecordingStream, prediction: Prediction | None) -> None:
        """Draw the expected result of a move, for all times, in grey; None removes it."""
        F = np.zeros((0, len(self.front.names))) if prediction is None else prediction.objectives[None]
        self._scatter.log_points(stream, "predicted", F, static=True)
        if self._motions[0] is not None:
            motion = None if prediction is None else record_motion(prediction.motion, curves=False)
            self._motions[0].log_predicted(stream, motion)

    def blueprint(self) -> rrb.Blueprint:
        """Return the layout, with the views of the recorded run, if any, in a second tab.

        The text of one choice is next to the arm; texts of two, or in a narrow viewer, are below the front.
        """
        arms = [motion_views(motions) for motions in self._motions if motions is not None]
        texts = [
            rrb.TextDocumentView(origin=f"{root}/text", name=name)
            for root, name in zip(ROOTS, self._names, strict=False)
        ]
        tab = None if self.recorded is None else self.recorded.tab()
        front, name, further = self._scatter.view(), " and ".join(self._names), [] if tab is None else [tab]
        settings: Any = {"legend": self._legend, "front": front, "timeline": self._timeline, "name": name}
        if len(texts) == 1 and self.width >= VIEWS.width:
            views = arms[0] if arms else {}
            return Layout(charts=(), texts=texts, further=further, **settings, **views).blueprint()
        columns = [column(front, texts), *(column(each["arm"], each["joints"]) for each in arms)]
        body = self._legend.above(rrb.Horizontal(*(each for each in columns if each is not None)), name)
        panel = rrb.TimePanel(timeline=self._timeline, state="collapsed", fps=DRAWING.frames)
        return tabbed([body, *further], panel)

    @property
    def _timeline(self) -> str:
        """The timeline that plays: the motion's, or the recorded run's if arms stand still."""
        return "motion" if self.recorded is None or is_moving(self._points) else self.recorded.timeline

    @cached_property
    def _scatter(self) -> Scatter:
        names, units, maximised = (tuple(getattr(self.front, name)) for name in ("names", "units", "maximised"))
        scene = SearchedFront(names=names, units=units, maximised=maximised)
        return Scatter(scene=scene, shown=self.front.objectives, root=(ROOTS[0],))

    @cached_property
    def _points(self) -> list[RecordedPoint]:
        return [chosen_point(choice) for choice in self.choices]

    @cached_property
    def _motions(self) -> list[MotionScene | None]:
        """The arms of the choices on the same axes; None without a workcell or motions."""
        cell = workcell_of(self.front.problem)
        if cell is None and isinstance(self.front.motions, Motion):  # without the problem only the arm is known
            cell = Workcell(arm=self.front.motions.arm)
        if cell is None or any(point.motion is None for point in self._points):
            return [None] * len(self.choices)
        names, points = tuple(self.front.names), [*self._points, *self.around]
        return [
            MotionScene(workcell=cell, names=names, points=points, title=name, root=f"{root}/")
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


def show_choice_in_recording(front: Front, *, moved: Choice | None = None, source: Path | None = None) -> None:
    """Set the recording in a front's folder to open on the present choice; without one, as recorded.

    moved: point that a move reached; shown next to the present choice, if there is one
    source: recording to start from, by default the folder's own

    The recording of a closed loop already has its motion and stays unchanged. If a recording cannot be read or
    replaced, it stays unchanged too, with a warning: the choice, or point, is stored elsewhere.
    """
    if front.folder is None or is_loop(front):
        return
    recording = front.folder / RECORDING
    try:
        with only_writer(front.folder):  # the recording then shows the last of several choices
            check_no_run(front.folder)
            point = front.choices.chosen
            if point is not None and point.point not in front:  # the point of a newer front
                return
            shown = {each.id: each for each in (chosen(front), moved) if each is not None}
            choice, compare = (*shown.values(), None, None)[:2]
            content = recording_with_choice(front, choice, recording=source or recording, compare=compare)
            replace_file(recording, content, check=RecordedRun)  # empty if Rerun is switched off
    except Exception as fault:  # a view may fail in any way
        cause = str(fault) if isinstance(fault, ParetoikError) else f"{recording}: {type(fault).__name__}: {fault}"
        what = "choice" if moved is None else "point"
        warn_user(f"the {what} is saved, but the recording is unchanged: {' '.join(cause.split())}")


def recording_with_choice(
    front: Front, choice: Choice | None, *, recording: Path, compare: Choice | None = None
) -> bytes:
    """Return the content of a recording that opens on a choice; without one, as recorded.

    ``compare``: another choice, shown next to it. Earlier choices are removed. Raises InvalidInput if the recording
    cannot be read.
    """
    recorded, opens = RecordedRun(recording), choice is None
    store = recorded.store
    with stream_in_memory(store.application_id, OPTIONS.batch, store.recording_id) as (stream, content):
        stream.send_chunks(recorded.data())
        if (layout := recorded.layout()) is not None:
            stream.send_blueprint(layout, make_active=opens, make_default=opens)
        if choice is not None:
            choices = (choice,) if compare is None else (choice, compare)
            layer = ChoiceLayer(front=front, choices=choices, recorded=recorded)
            layer.log(stream)
            stream.send_blueprint(layer.blueprint(), make_active=True, make_default=True)
    return bytes(content)

"""The layout of a recording in the viewer: legend, front and charts, arm and joints, words; and its stream."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.drawing.axes import TEXT, labels, text_width
from paretoik.review.palette import DRAWING, SCREEN, VIEWS, Colour

# Tabs whose names are all readable.


Group: TypeAlias = tuple[str, list[int]]  # the name of a tab, and the numbers of its views


def fitting_tabs(views: Sequence[rrb.View], width: float) -> rrb.Tabs:
    """Return views as tabs in a column of a ``width`` [pixels].

    If the names do not fit, their units are left out. If that is not enough, views whose names begin with the same word
    become nested tabs, named by this word. Last, the longest names are cut.
    """
    names, groups = _arrange([str(view.name) for view in views], width)
    tabs = list[rrb.View | rrb.Tabs]()
    for view, name in zip(views, names, strict=True):
        view.name = name
    for name, members in groups:
        group = [views[number] for number in members]
        if len(group) == 1:
            group[0].name = name
        tabs.append(group[0] if len(group) == 1 else rrb.Tabs(*group, name=name))
    return rrb.Tabs(*tabs)


def nested_tabs(names: Sequence[str], width: float) -> list[bool]:
    """Return which views become nested tabs, below a second row of ``names``."""
    nested = {number for _, members in _arrange(names, width)[1] if len(members) > 1 for number in members}
    return [number in nested for number in range(len(names))]


def _arrange(names: Sequence[str], width: float) -> tuple[list[str], list[Group]]:
    """Return the shown names of views, and the tabs."""
    room, shown = width - VIEWS.tab_controls, list(names)
    if _width(shown) > room:  # without units
        shown = [re.sub(r" \[[^\]]*\]", "", name, count=1) for name in shown]
    groups: list[Group] = [(name, [number]) for number, name in enumerate(shown)]
    first = [name.split(" ")[0] for name in shown]
    for word, count in Counter(first).most_common():
        if count > 1 and _width([name for name, _ in groups]) > room:  # one group, at the place of its first view
            members = [number for number, each in enumerate(first) if each == word]
            joined = [(word, members) if group[1] == members[:1] else group for group in groups]
            groups = [group for group in joined if group[1] == members or group[1][0] not in members]
    tabs = [name for name, _ in groups]
    while _width(tabs) > room and max(map(len, tabs)) > 2:
        longest = tabs.index(max(tabs, key=len))
        tabs[longest] = tabs[longest].rstrip("…")[:-1] + "…"
    return shown, [(name, members) for name, (_, members) in zip(tabs, groups, strict=True)]


def _width(names: Sequence[str]) -> float:
    return sum(VIEWS.tab_margin + VIEWS.tab_character * len(name) for name in names)


BULLET = "● "
Entry: TypeAlias = tuple[str, Colour]


@dataclass(frozen=True, kw_only=True)
class Legend:
    """A legend at ``entity``: words and their colours, in rows of a ``width`` [pixels]."""

    entries: Sequence[Entry]
    entity: str = "legend"
    width: float = VIEWS.width

    def above(self, views: rrb.Container, name: str) -> rrb.Container:
        """Return views with the legend above them."""
        bounds = rrb.VisualBounds2D(x_range=[0.0, self.width], y_range=[0.0, self.height])
        settings: Any = {"titlebar": False, "background": SCREEN.background}
        strip = rrb.Spatial2DView(origin=self.entity, name="legend", visual_bounds=bounds, **settings)
        return rrb.Vertical(strip, views, row_shares=[self.height, VIEWS.body - self.height], name=name)

    @property
    def height(self) -> float:
        """The height of the strip [pixels]."""
        return TEXT.row * (1 + max(row for row, _ in self._places()))

    def log(self, recording: rr.RecordingStream) -> None:
        """Draw the words, for all times."""
        words, colours = [BULLET + word for word, _ in self.entries], [colour for _, colour in self.entries]
        beside = zip(words, self._places(), strict=True)
        middles = np.array([(x + 0.5 * text_width(word), (row + 0.5) * TEXT.row) for word, (row, x) in beside])
        recording.log(f"{self.entity}/words", labels(words, middles, colours), static=True)

    def _places(self) -> list[tuple[int, float]]:
        """Return the row of each entry, and its left end [pixels]."""
        places, row, x = list[tuple[int, float]](), 0, 24.0
        for word, _ in self.entries:
            width = text_width(BULLET + word) + 36.0  # with a reserve for smaller windows
            if x + width > self.width and x > 24.0:
                row, x = row + 1, 24.0
            places.append((row, x))
            x += width
        return places


def drawn_entries(*entries: tuple[str, Colour, object]) -> list[Entry]:
    """Return the words and colours of a legend's entries whose last part is true."""
    return [(words, colour) for words, colour, is_drawn in entries if is_drawn]


TEXT_ENTITY = "text"  # entity of the text about the point shown
LEFT_OUT = "notes/left_out"  # entity of the note about what was left out


@dataclass(frozen=True, kw_only=True)
class Layout:
    """The views of a recording: the ``front`` above its ``charts``, the ``arm`` above its ``joints``, then ``texts``.

    note: text on what was left out, the last of the texts
    timeline: timeline that plays
    start: first instant of the looped range; by default the timeline plays from its beginning
    end: last instant of the looped range
    frames: speed of a timeline that counts [1/s]
    further: views of further tabs, next to the tab of all these
    """

    legend: Legend
    front: rrb.View | None
    charts: Sequence[rrb.View]
    texts: Sequence[rrb.View]
    timeline: str
    arm: rrb.View | None = None
    joints: Sequence[rrb.View] = ()
    note: str = ""
    start: int | None = None
    end: int = 0
    name: str = "search"
    frames: float = DRAWING.frames
    further: Sequence[rrb.Container] = ()

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw the legend and the note, for all times, and send the layout."""
        self.legend.log(stream)
        if self.note:
            stream.log(LEFT_OUT, rr.TextDocument(self.note), static=True)
        stream.send_blueprint(self.blueprint())

    def blueprint(self) -> rrb.Blueprint:
        """Return the layout for the viewer."""
        front, charts = self.front, list(self.charts)
        if front is None and charts:
            front, charts = charts[0], charts[1:]
        notes = [rrb.TextDocumentView(origin=LEFT_OUT, name="left out")] if self.note else []
        texts = [*self.texts, *notes]
        words = fitting_tabs(texts, VIEWS.columns[2]) if texts else None
        columns = (column(front, charts), column(self.arm, self.joints), words)
        present = [(each, width) for each, width in zip(columns, VIEWS.columns, strict=True) if each is not None]
        views = rrb.Horizontal(*(column for column, _ in present), column_shares=[width for _, width in present])
        looped: dict[str, Any] = {}
        if self.start is not None:  # a viewer begins at the start of the range that it loops
            selection = rrb.components.AbsoluteTimeRange(min=self.start, max=max(self.end, self.start + 1))
            looped = {"play_state": "playing", "loop_mode": "selection", "time_selection": selection}
        panel = rrb.TimePanel(timeline=self.timeline, state="collapsed", fps=self.frames, **looped)
        return tabbed([self.legend.above(views, self.name), *self.further], panel)


def tabbed(tabs: Sequence[rrb.Container], panel: rrb.TimePanel) -> rrb.Blueprint:
    """Return a layout of one container, or of several as tabs, with the time panel only."""
    body = tabs[0] if len(tabs) == 1 else rrb.Tabs(*tabs)
    hidden = rrb.BlueprintPanel(state="hidden"), rrb.SelectionPanel(state="hidden")
    return rrb.Blueprint(body, *hidden, panel, auto_views=False)


def set_times(stream: rr.RecordingStream, **times: float | np.generic) -> None:
    """Set the current time on these timelines only; floats are seconds, integers are counts."""
    stream.reset_time()
    for name, time in times.items():
        instant: dict[str, Any] = {"duration" if isinstance(time, float | np.timedelta64) else "sequence": time}
        stream.set_time(name, **instant)


def text_view(name: str) -> rrb.View:
    """Return the view of the text about the point shown."""
    return rrb.TextDocumentView(origin=TEXT_ENTITY, name=name)


def log_text(stream: rr.RecordingStream, words: str, entity: str = TEXT_ENTITY, *, static: bool = False) -> None:
    """Show a text in Markdown, at the current time or for all times."""
    stream.log(entity, rr.TextDocument(words, media_type="text/markdown"), static=static)


def column(above: rrb.View | None, below: Sequence[rrb.View]) -> rrb.Container | None:
    """Return a view above others, which are tabs; None without views."""
    views = ([above] if above is not None else []) + ([fitting_tabs(below, VIEWS.panels[0])] if below else [])
    shares = [VIEWS.panels[1] + VIEWS.title, VIEWS.chart[1] + VIEWS.title][: len(views)]
    return rrb.Vertical(*views, row_shares=shares) if views else None


class RecordedLayout(rrb.Blueprint):
    """The layout of a recording, to be written again unchanged."""

    def __init__(self, chunks: rr.chunk.LazyChunkStream) -> None:
        super().__init__()
        self._chunks = chunks

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        stream.send_chunks(self._chunks)


@contextmanager
def stream_in_memory(
    application: str, batch: int, identity: str | None = None
) -> Iterator[tuple[rr.RecordingStream, bytearray]]:
    """Yield a stream, and a buffer that has its content afterwards.

    Rerun's file sink is not used, because it may hang on a full disk. ``batch``: size of a chunk [bytes]; many small
    chunks make large files.
    """
    batcher, content = rr.ChunkBatcherConfig(flush_tick=3600.0, flush_num_bytes=batch), bytearray()
    stream = rr.RecordingStream(
        application, recording_id=identity, batcher_config=batcher, send_properties=identity is None
    )
    memory = stream.memory_recording()
    yield stream, content
    stream.flush()
    content += memory.drain_as_bytes()
    stream.disconnect()

"""What recordings of finished searches and closed loops share: where fronts and their charts are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import rerun as rr
import rerun.blueprint as rrb

from paretoik.arrays import Objectives
from paretoik.review.drawing.drawn_axes import Canvas
from paretoik.review.drawing.front_panels import outside_panels
from paretoik.review.drawing.parallel_axes import ParallelAxes
from paretoik.review.drawing.recording_layout import TEXT, note_view
from paretoik.review.drawing.search_charts import DrawnChart, fit_drawn_charts, log_series, search_charts
from paretoik.review.drawing.search_scene import SearchScene
from paretoik.review.recording.recorder import Generation, SearchedFront, SearchEnd


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedSearch:
    """All ``generations`` of a search, or steps of a closed loop, and its ``end``; ``note`` says what was left out."""

    scene: SearchScene
    recorded: SearchedFront
    generations: Sequence[Generation]
    end: SearchEnd
    note: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class FrontViews:
    """The views of a search's fronts, on axes that hold all of ``shown``, and of how it went; ``note`` is its note."""

    search: RecordedSearch
    shown: Objectives
    note: str

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw axes, charts and the note, for all times."""
        self.search.scene.log_axes(stream, self.canvases, static=True)
        if self.parallel is not None:
            self.parallel.log(stream, static=True)
        for chart, instants, curves in self._charts:
            chart.log(stream)
            chart.draw(stream, instants, curves, static=True)
        if self.note:
            stream.log("notes/left_out", rr.TextDocument(self.note), static=True)

    def log_generation(self, stream: rr.RecordingStream, generation: Generation, words: str) -> None:
        """Draw a generation or step at the current time, with what is said of it."""
        final = None if self.search.end.front is None else self.search.end.front.objectives
        behind = None if self.search.scene.timeline == "step" else final
        self.search.scene.log_generation(stream, generation, self.canvases, self.parallel, behind=behind)
        log_series(self.search.scene, stream, generation)
        stream.log(TEXT, rr.TextDocument(words, media_type="text/markdown"))
        self.log_cursors(stream, generation.number)

    def log_note(self, stream: rr.RecordingStream, words: str) -> None:
        """Say where points would be why there are none, at the current time; without words, no longer."""
        self.search.scene.log_note(stream, self.canvases, words)

    def log_cursors(self, stream: rr.RecordingStream, number: int) -> None:
        """Let the cursors of charts stand at a generation or step, at the current time."""
        for chart, _, _ in self._charts:
            chart.log_cursor(stream, float(number))

    def outside(self, generation: Generation) -> int:
        """Return how many individuals of a generation lie outside the axes of at least one panel."""
        return outside_panels(self.search.scene.panels.pairs, self.canvases, generation.population)

    @property
    def front(self) -> rrb.View | None:
        """The view of all pairs of objectives; None where nothing finite is shown."""
        return self.search.scene.view() if self.canvases else None

    @property
    def charts(self) -> list[rrb.View]:
        """The views below that of the front."""
        parallel = [] if self.parallel is None else [self.parallel.view()]
        return [*parallel, *(chart.view() for chart, _, _ in self._charts)]

    @property
    def notes(self) -> list[rrb.View]:
        """The view of the note, where there is one."""
        return [note_view()] if self.note else []

    @cached_property
    def canvases(self) -> list[Canvas]:
        """The axes of every pair of objectives."""
        return self.search.scene.canvases(self.shown)

    @cached_property
    def parallel(self) -> ParallelAxes | None:
        """The axes of parallel coordinates, from three objectives on."""
        return self.search.scene.parallel_axes(self.shown)

    @cached_property
    def _charts(self) -> list[DrawnChart]:
        names_before = [] if self.parallel is None else [str(self.parallel.view().name)]
        return fit_drawn_charts(search_charts(self.search.scene, self.search.generations), names_before)

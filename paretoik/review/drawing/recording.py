"""How a search is recorded: generations as they come, and at the end all of them on common axes, with motions."""

from __future__ import annotations

from collections.abc import Sequence

import rerun as rr

from paretoik.review.drawing.drawn_axes import Canvas
from paretoik.review.drawing.finished_loop import FinishedLoop
from paretoik.review.drawing.finished_search import FinishedSearch
from paretoik.review.drawing.front_views import RecordedSearch
from paretoik.review.drawing.legend import Legend
from paretoik.review.drawing.legend_entries import search_entries
from paretoik.review.drawing.motion_scene import MotionScene
from paretoik.review.drawing.parallel_axes import ParallelAxes
from paretoik.review.drawing.point_text import text_of
from paretoik.review.drawing.recording_layout import TEXT, Layout, text_view
from paretoik.review.drawing.replay_clock import has_motions
from paretoik.review.drawing.search_charts import log_series, log_styles, series_views
from paretoik.review.drawing.search_scene import SearchScene
from paretoik.review.recording.front_reduction import FrontReduction, reduction_note
from paretoik.review.recording.recorder import Generation, SearchedFront, SearchEnd
from paretoik.review.recording.recording_process import RecorderOptions


class Recording:
    """Draws a search into a stream; errors of Rerun are raised.

    While the search runs, each generation is drawn on its own axes. The common axes of all are known only at its end,
    so `finish` draws all of them again, into another stream.
    """

    def __init__(self, scene: SearchedFront, stream: rr.RecordingStream, options: RecorderOptions) -> None:
        self._recorded = scene
        self._scene = SearchScene(
            names=scene.names, units=scene.units, maximised=scene.maximised, timeline=scene.timeline
        )
        self._stream = stream
        self._reduction = FrontReduction(maximised=scene.maximised, points=options.points)
        self._canvases: list[Canvas] = []
        self._parallel: ParallelAxes | None = None
        self._motions: MotionScene | None = None
        self._layout: Layout | None = None
        log_styles(self._scene, stream)

    def reduce(self, generation: Generation) -> Generation:
        """Return a generation with at most so many points as are drawn, and its hypervolume."""
        return self._reduction.reduce(generation)

    def record(self, generation: Generation) -> None:
        """Draw a generation while the search goes on."""
        stream, scene = self._stream, self._scene
        stream.set_time(scene.timeline, sequence=generation.number)
        shown = generation.front if len(generation.front) else generation.population
        changed = self._layout is None
        if not scene.fits(self._canvases, shown):
            changed |= not self._canvases
            self._canvases, self._parallel = scene.canvases(shown), scene.parallel_axes(shown)
            scene.log_axes(stream, self._canvases, static=False)
            if self._parallel is not None:
                self._parallel.log(stream, static=False)
        changed |= self._begin_motions(generation)
        if changed:
            self._send_layout()
        scene.log_generation(stream, generation, self._canvases, self._parallel)
        log_series(scene, stream, generation)
        stream.log(TEXT, rr.TextDocument(text_of(scene, generation), media_type="text/markdown"))
        if self._motions is not None:
            self._motions.log_whole(stream, generation.points)

    def finish(self, generations: Sequence[Generation], end: SearchEnd | None, note: str) -> None:
        """Draw everything on common axes, at the end the front and the motion of the choice, and a note if any.

        Without a front each generation stands at its own sample of the motion, and the search of some is shown beside
        them. Without an end the last generation is the end.
        """
        end = SearchEnd(front=None) if end is None else end
        note = " ".join(filter(None, (note, reduction_note(generations))))
        kind = FinishedLoop if self._scene.timeline == "step" else FinishedSearch
        search = RecordedSearch(scene=self._scene, recorded=self._recorded, generations=generations, end=end, note=note)
        kind(search=search).log(self._stream)

    def _begin_motions(self, generation: Generation) -> bool:
        """Draw the workcell once there are motions; say whether that was now."""
        cell, points = self._recorded.workcell, generation.points
        if self._motions is not None or cell is None or not has_motions(points):
            return False
        self._motions = MotionScene(workcell=cell, names=self._scene.names, points=points)
        self._motions.log(self._stream)
        return True

    def _send_layout(self) -> None:
        scene, motions = self._scene, self._motions
        legend = Legend(entity="legend", entries=search_entries(scene, motions))
        legend.log(self._stream)
        parallel = [] if self._parallel is None else [self._parallel.view()]
        self._layout = Layout(
            legend=legend,
            front=scene.view() if self._canvases else None,
            charts=[*parallel, *series_views(scene)],
            arm=None if motions is None else motions.view(),
            joints=[] if motions is None else [chart.view() for chart in motions.charts.values()],
            texts=[text_view(scene.timeline)],
            timeline=scene.timeline,
        )
        self._stream.send_blueprint(self._layout.blueprint())

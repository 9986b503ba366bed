"""The recording of a tool path: the path, the moving tool, its speed and its distance to the target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.drawing.axes import Canvas, screen_text, window
from paretoik.review.drawing.charts import Chart
from paretoik.review.drawing.layout import TEXT_ENTITY as TEXT
from paretoik.review.drawing.layout import Layout, Legend, text_view
from paretoik.review.drawing.search_charts import DrawnChart, fit_drawn_charts
from paretoik.review.drawing.space import fitting_eye
from paretoik.review.palette import DRAWING, SCREEN, VIEWS, Colour, even_rows
from paretoik.review.recording.messages import PathEnd, PathScene
from paretoik.review.words import run_text

ENTITY = "path"


@dataclass(frozen=True, kw_only=True, eq=False)
class FinishedPath:
    """A tool path on the timeline ``motion`` [s]; ``note``: what was left out."""

    scene: PathScene
    messages: Sequence[object]
    end: PathEnd
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        self._layout.legend.log(stream)
        if self._planar:
            self._canvas.log(stream, ENTITY, static=True)
        if self.end.reference is not None:
            self._log_line(stream, "reference", self.end.reference, SCREEN.target)
        self._log_line(stream, "line", self.end.tool, SCREEN.path)
        self._log_points(stream, "ends", np.stack([self.scene.start, self.scene.target]), SCREEN.text, static=True)
        for chart, instants, curves in self._charts:
            chart.log(stream)
            chart.draw(stream, instants, curves, static=True)
        stream.log(TEXT, rr.TextDocument(self._words, media_type="text/markdown"), static=True)
        for row in even_rows(len(self.end.times), DRAWING.walk):
            stream.set_time("motion", duration=float(self.end.times[row]))
            self._log_points(stream, "tool", self.end.tool[row, None], SCREEN.tool, static=False)
            for chart, _, _ in self._charts:
                chart.log_cursor(stream, float(self.end.times[row]))
        stream.reset_time()
        stream.send_blueprint(self._layout.blueprint())

    def _log_line(self, stream: rr.RecordingStream, name: str, points: np.ndarray, colour: Colour) -> None:
        radius = rr.Radius.ui_points(1.0)
        if self._planar:
            line: rr.LineStrips2D | rr.LineStrips3D = rr.LineStrips2D(
                [self._canvas.place(points)], colors=[colour], radii=radius
            )
        else:
            line = rr.LineStrips3D([points], colors=[colour], radii=radius)
        stream.log(f"{ENTITY}/{name}", line, static=True)

    def _log_points(
        self, stream: rr.RecordingStream, name: str, points: np.ndarray, colour: Colour, *, static: bool
    ) -> None:
        radius = rr.Radius.ui_points(4.5)
        if self._planar:
            dots: rr.Points2D | rr.Points3D = rr.Points2D(
                self._canvas.place(points), colors=colour, radii=radius, draw_order=3.0
            )
        else:
            dots = rr.Points3D(points, colors=colour, radii=radius)
        stream.log(f"{ENTITY}/{name}", dots, static=static)

    @property
    def _planar(self) -> bool:
        return self.end.tool.shape[1] == 2

    @cached_property
    def _points(self) -> np.ndarray:
        """All drawn points of the path."""
        reference = self.end.tool[:0] if self.end.reference is None else self.end.reference
        return np.concatenate([self.end.tool, reference, self.scene.start[None], self.scene.target[None]])

    @cached_property
    def _canvas(self) -> Canvas:
        """The plane of the path, with equal scales on both axes."""
        width, height = VIEWS.panels[0] - 100.0, VIEWS.panels[1] - 110.0
        low, high = window(self._points)
        scale = max((high - low) / (width, height))
        half = scale * np.array([width, height]) / 2
        middle = (low + high) / 2
        return Canvas(low=middle - half, high=middle + half, labels=("x [m]", "y [m]"), width=width, height=height)

    def _view(self) -> rrb.View:
        name = screen_text(self.scene.title)
        if self._planar:
            bounds = self._canvas.bounds()
            return rrb.Spatial2DView(origin=ENTITY, name=name, visual_bounds=bounds, background=SCREEN.background)
        eye = fitting_eye(self._points)
        return rrb.Spatial3DView(origin=ENTITY, name=name, background=SCREEN.background, eye_controls=eye)

    @cached_property
    def _charts(self) -> list[DrawnChart]:
        end = self.end
        return fit_drawn_charts(
            [
                _chart("speed", "tool speed [m/s]", end.middles, end.speed),
                _chart("distance", "distance to the target [m]", end.times, end.distance),
            ]
        )

    @property
    def _words(self) -> str:
        end = self.end
        lines = [f"# {self.scene.title}", f"- {end.times[-1]:.6g} s, {len(end.times)} samples"]
        lines.append(f"- ends {end.distance[-1]:.3g} m from the target")
        return screen_text("\n".join([*lines, "", run_text(end.provenance)]))

    @cached_property
    def _layout(self) -> Layout:
        entries = [("path of the tool", SCREEN.path), ("tool", SCREEN.tool), ("start and target", SCREEN.text)]
        if self.end.reference is not None:
            entries.append(("reference", SCREEN.target))
        return Layout(
            legend=Legend(entity="legend", entries=entries),
            front=self._view(),
            charts=[chart.view() for chart, _, _ in self._charts],
            arm=None,
            joints=[],
            texts=[text_view("run")],
            timeline="motion",
            name=self.scene.title,
        )


def _chart(name: str, label: str, instants: np.ndarray, values: np.ndarray) -> DrawnChart:
    chart = Chart(
        entity=f"charts/{name}",
        title=label,
        labels=("time [s]", label),
        shown=np.stack([instants, values], axis=1),
        names=[label],
        colours=[SCREEN.tool],
    )
    return chart, instants, values[None]

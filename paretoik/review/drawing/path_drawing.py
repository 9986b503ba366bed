"""The recording of a tool path: the path, the moving tool, its speed and its distance to the target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.drawing.axes import screen_text
from paretoik.review.drawing.charts import Chart, fit_below_tabs
from paretoik.review.drawing.layout import Layout, Legend, log_text, text_view
from paretoik.review.drawing.space import Stage, fitting_eye
from paretoik.review.palette import DRAWING, SCREEN, even_rows
from paretoik.review.recording.messages import PathEnd, PathScene, in_space
from paretoik.review.words import run_text

ENTITY = "path"


@dataclass(frozen=True, kw_only=True, eq=False)
class PathDrawing:
    """A tool path on the timeline ``motion`` [s]; ``note``: what was left out."""

    scene: PathScene
    messages: Sequence[object]
    end: PathEnd
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        stage, tool = self._stage, in_space(self.end.tool)
        if stage.planar:
            stage.canvas.log(stream, ENTITY, static=True)
        if self.end.reference is not None:
            reference = stage.strips([in_space(self.end.reference)], SCREEN.target, 1.0, 20.0)
            stream.log(f"{ENTITY}/reference", reference, static=True)
        stream.log(f"{ENTITY}/line", stage.strips([tool], SCREEN.path, 1.0, 20.0), static=True)
        ends = in_space(np.stack([self.scene.start, self.scene.target]))
        stream.log(f"{ENTITY}/ends", stage.points(ends, SCREEN.text, 4.5, 3.0), static=True)
        for chart in self._charts:
            chart.log(stream)
        log_text(stream, self._words, static=True)
        for row in even_rows(len(self.end.times), DRAWING.walk):
            stream.set_time("motion", duration=float(self.end.times[row]))
            stream.log(f"{ENTITY}/tool", stage.points(tool[row, None], SCREEN.tool, 4.5, 3.0))
            for chart in self._charts:
                chart.log_cursor(stream, float(self.end.times[row]))
        stream.reset_time()
        self._layout.log(stream)

    @cached_property
    def _stage(self) -> Stage:
        """The plane or space of the path."""
        reference = self.end.tool[:0] if self.end.reference is None else self.end.reference
        seen = np.concatenate([self.end.tool, reference, self.scene.start[None], self.scene.target[None]])
        return Stage(entity=ENTITY, planar=seen.shape[1] == 2, seen=in_space(seen), margin=0.06)

    def _view(self) -> rrb.View:
        if self._stage.planar:
            return self._stage.view(self.scene.title)
        return rrb.Spatial3DView(
            origin=ENTITY,
            name=screen_text(self.scene.title),
            background=SCREEN.background,
            eye_controls=fitting_eye(self._stage.seen),
        )

    @cached_property
    def _charts(self) -> list[Chart]:
        end = self.end
        return fit_below_tabs(
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

    @property
    def _layout(self) -> Layout:
        entries = [("path of the tool", SCREEN.path), ("tool", SCREEN.tool), ("start and target", SCREEN.text)]
        if self.end.reference is not None:
            entries.append(("reference", SCREEN.target))
        return Layout(
            legend=Legend(entries=entries),
            front=self._view(),
            charts=[chart.view() for chart in self._charts],
            texts=[text_view("run")],
            timeline="motion",
            name=self.scene.title,
        )


def _chart(name: str, label: str, instants: np.ndarray, values: np.ndarray) -> Chart:
    return Chart(
        entity=f"charts/{name}",
        title=label,
        labels=("time [s]", label),
        names=[label],
        colours=[SCREEN.tool],
        instants=instants,
        curves=values[None],
    )

"""The recording of a tool path: the path, the moving tool, its speed and its distance to the target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

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
            stage.canvas.log(stream, ENTITY)
        if self.end.reference is not None:
            reference = stage.strips([in_space(self.end.reference)], SCREEN.target, 1.0, 20.0)
            stream.log(f"{ENTITY}/reference", reference, static=True)
        stream.log(f"{ENTITY}/line", stage.strips([tool], SCREEN.path, 1.0, 20.0), static=True)
        ends = in_space(np.stack([self.scene.start, self.scene.target]))
        stream.log(f"{ENTITY}/ends", stage.points(ends, SCREEN.text, 4.5, 3.0), static=True)
        for chart in self._charts:
            chart.log(stream)
        lines = [f"# {self.scene.title}", f"- {self.end.times[-1]:.6g} s, {len(self.end.times)} samples"]
        lines += [f"- ends {self.end.distance[-1]:.3g} m from the target", "", run_text(self.end.provenance)]
        log_text(stream, screen_text("\n".join(lines)), static=True)
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

    @cached_property
    def _charts(self) -> list[Chart]:
        curves = {
            "speed": ("tool speed [m/s]", self.end.middles, self.end.speed),
            "distance": ("distance to the target [m]", self.end.times, self.end.distance),
        }
        return fit_below_tabs(
            [
                Chart.over("time [s]", name, label, times, values[None], [SCREEN.tool])
                for name, (label, times, values) in curves.items()
            ]
        )

    @property
    def _layout(self) -> Layout:
        entries = [("path of the tool", SCREEN.path), ("tool", SCREEN.tool), ("start and target", SCREEN.text)]
        if self.end.reference is not None:
            entries.append(("reference", SCREEN.target))
        view = self._stage.view(self.scene.title)
        if not self._stage.planar:  # no ground: the eye looks at the path only
            settings: Any = {"origin": ENTITY, "name": view.name, "background": SCREEN.background}
            view = rrb.Spatial3DView(eye_controls=fitting_eye(self._stage.seen), **settings)
        return Layout(
            legend=Legend(entries=entries),
            front=view,
            charts=[chart.view() for chart in self._charts],
            texts=[text_view("run")],
            timeline="motion",
            name=self.scene.title,
        )

"""The panel of directional maxima: their vectors, in the plane as a polygon, in space as rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.drawing.drawn_axes import Canvas, equal_window
from paretoik.review.drawing.ground import Ground
from paretoik.review.drawing.label_places import joined_label, no_label
from paretoik.review.palette import SCREEN, Colour
from paretoik.review.recording.measured_maxima import MaximaEnd, MaximaScene

ENTITY = "maxima"


@dataclass(frozen=True, kw_only=True, eq=False)
class MaximaPanel:
    """The maxima of an ``end`` as vectors from the origin, on axes of speed or force."""

    scene: MaximaScene
    end: MaximaEnd

    def view(self) -> rrb.View:
        """Return the view."""
        name = f"highest {self.scene.word} in each direction"
        if self.planar:
            bounds = self._canvas.bounds()
            return rrb.Spatial2DView(origin=ENTITY, name=name, visual_bounds=bounds, background=SCREEN.background)
        return rrb.Spatial3DView(
            origin=ENTITY,
            name=name,
            background=SCREEN.background,
            line_grid=False,
            eye_controls=self._ground.eye(),
        )

    def log(self, recording: rr.RecordingStream) -> None:
        """Draw axes, and behind all that follows all maxima, for all times."""
        if self.planar:
            self._canvas.log(recording, f"{ENTITY}/axes", static=True)
        else:
            recording.log(ENTITY, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            self._ground.log(recording, f"{ENTITY}/axes")
        everything = (
            self._outline(len(self.end), SCREEN.final, 0.8, 0.5)
            if self.planar
            else self._rays(len(self.end), SCREEN.final, 0.8)
        )
        recording.log(f"{ENTITY}/final", everything, static=True)
        origin = self._points(np.zeros((1, 3)), SCREEN.target, 4.0, 1.0)
        recording.log(f"{ENTITY}/origin", origin, static=True)

    def log_until(self, recording: rr.RecordingStream, count: int) -> None:
        """Draw the first so many maxima, the last of them as the chosen one."""
        tips = self.tips[:count]
        is_reached = np.isfinite(tips).all(axis=1)
        recording.log(f"{ENTITY}/rays", self._rays(count, SCREEN.front, 0.6))
        recording.log(f"{ENTITY}/outline", self._outline(count, SCREEN.front, 1.6, 2.0))
        names = [f"direction {number}" for number in np.flatnonzero(is_reached) + 1]
        corners = self._points(tips[is_reached], SCREEN.front, 3.2, 3.0, labels=names, show_labels=False)
        recording.log(f"{ENTITY}/corners", corners)
        chosen = tips[count - 1 : count][is_reached[-1:]]
        arrow = [np.stack([np.zeros(3), tip]) for tip in chosen]
        recording.log(f"{ENTITY}/chosen/ray", self._strips(arrow, SCREEN.chosen, 2.0, 4.0))
        recording.log(f"{ENTITY}/chosen/tip", self._points(chosen, SCREEN.chosen, 6.0, 5.0))
        recording.log(f"{ENTITY}/chosen/name", *self._name(chosen, f"direction {count}"))

    def _name(self, tip: np.ndarray, words: str) -> Sequence[Any]:
        """Return the name of a tip (0 or 1, 3), in the plane off all rays and corners."""
        if not len(tip):
            return no_label() if self.planar else [rr.Points3D([])]
        if not self.planar:
            radii = rr.Radius.ui_points(0.0)
            return [rr.Points3D(1.12 * tip, labels=[words], show_labels=True, colors=SCREEN.chosen, radii=radii)]
        shares = np.linspace(0.0, 1.0, 12)[:, None, None]
        rays = (shares * self.tips[np.isfinite(self.tips).all(axis=1), :2]).reshape(-1, 2)
        at = self._canvas.place
        return joined_label(self._canvas, at(tip[0, :2]), words, at(rays), SCREEN.chosen)

    @property
    def planar(self) -> bool:
        """Whether the maxima lie in a plane."""
        return self.end.directions.shape[1] == 2

    @cached_property
    def tips(self) -> np.ndarray:
        """The maxima as vectors (directions, 3), NaN where none was found."""
        vectors = self.end.values[:, None] * self.end.directions
        return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))

    def _rays(self, count: int, colour: Colour, radius: float) -> Any:
        tips = self.tips[:count]
        rays = [np.stack([np.zeros(3), tip]) for tip in tips if np.isfinite(tip).all()]
        return self._strips(rays, colour, radius, 0.8)

    def _outline(self, count: int, colour: Colour, radius: float, order: float) -> Any:
        """Return the polygon through the first so many maxima, closed where these are all; in space none."""
        tips = self.tips[:count]
        tips = tips[np.isfinite(tips).all(axis=1)]
        if not self.planar or len(tips) < 2:
            return self._strips([], colour, radius, order)
        whole = count == len(self.end) and len(tips) > 2
        around = np.argsort(np.arctan2(tips[:, 1], tips[:, 0]), kind="stable") if whole else np.arange(len(tips))
        return self._strips([tips[np.append(around, around[0])] if whole else tips], colour, radius, order)

    def _strips(self, lines: list[np.ndarray], colour: Colour, radius: float, order: float) -> Any:
        radii = rr.Radius.ui_points(radius)
        if not self.planar:
            return rr.LineStrips3D(lines, colors=colour, radii=radii)
        placed = [self._canvas.place(line[:, :2]) for line in lines]
        return rr.LineStrips2D(placed, colors=colour, radii=radii, draw_order=order)

    def _points(self, places: np.ndarray, colour: Colour, radius: float, order: float, **more: Any) -> Any:
        radii = rr.Radius.ui_points(radius)
        if not self.planar:
            return rr.Points3D(places, colors=colour, radii=radii, **more)
        return rr.Points2D(self._canvas.place(places[:, :2]), colors=colour, radii=radii, draw_order=order, **more)

    @cached_property
    def _seen(self) -> np.ndarray:
        return np.concatenate([np.zeros((1, 3)), self.tips[np.isfinite(self.tips).all(axis=1)]])

    @property
    def _labels(self) -> tuple[str, str, str]:
        along = f"{self.scene.word} along " if self.planar else ""  # in space labels are short, to be in sight
        x, y, z = (f"{along}{axis} [{self.scene.unit}]" for axis in "xyz")
        return x, y, z

    @cached_property
    def _canvas(self) -> Canvas:
        flat = Canvas(low=np.zeros(2), high=np.ones(2), labels=self._labels[:2])
        seen = self._seen[:, :2] if len(self._seen) > 1 else np.array([[-1.0, -1.0], [1.0, 1.0]])
        low, high = equal_window(seen, width=flat.width, height=flat.height)
        return Canvas(low=low, high=high, labels=flat.labels)

    @cached_property
    def _ground(self) -> Ground:
        return Ground.around(self._seen, labels=self._labels)

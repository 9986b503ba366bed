"""Axes of a scene in space: a ground with a grid and ticks in metres, and a measured upright."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Vector3
from paretoik.review.drawing.drawn_axes import nice_ticks, tick_text
from paretoik.review.drawing.scene_eye import fitting_eye
from paretoik.review.drawing_options import SCENES
from paretoik.review.palette import SCREEN

METRES = ("x [m]", "y [m]", "z [m]")


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """The box from ``low`` to ``high`` (3,) [m] that a scene fills, with a grid of ``step`` [m] below it.

    ``seen`` are points that its view is to show. ``labels`` are those of its axes, which may count something else than
    metres.
    """

    low: Vector3
    high: Vector3
    step: float
    seen: Float[np.ndarray, "points 3"]
    labels: tuple[str, str, str] = METRES

    @staticmethod
    def around(points: np.ndarray, *, labels: tuple[str, str, str] = METRES) -> Ground:
        """Return the ground of points (points, 3), its corners on round lengths.

        It lies at 0 where all is above, or nearly all: what dips below it by less than half a step is seen through it.
        """
        low, high = points.min(axis=0), points.max(axis=0)
        width = max(float((high - low).max()), 1e-6)
        step = float(np.diff(nice_ticks(0.0, width, count=SCENES.grid))[0])
        middle, half = (low + high) / 2, np.maximum((high - low) / 2, 0.2 * width)
        low, high = np.minimum(low, middle - half), np.maximum(high, middle + half)
        lowest = float(points[:, 2].min())
        low[2] = min(lowest, 0.0) if lowest < width else low[2]
        low[2] = 0.0 if -0.5 * step < lowest < width else low[2]
        low, high = np.floor(low / step + 1e-6) * step, np.ceil(high / step - 1e-6) * step
        return Ground(low=low, high=high, step=step, seen=points, labels=labels)

    def log(self, recording: rr.RecordingStream, entity: str) -> None:
        """Draw grid, ticks and labels, for all times."""
        (x0, y0, z0), (x1, y1, z1) = self.low, self.high
        x, y, z = (self._ticks(axis) for axis in range(3))
        lines = [[(a, y0, z0), (a, y1, z0)] for a in x] + [[(x0, b, z0), (x1, b, z0)] for b in y]
        upright = [[(x0, y0, z0), (x0, y0, z1)]]
        marks = [[(x0, y0, c), (x0 + 0.15 * self.step, y0, c)] for c in z]
        colours = [SCREEN.grid] * len(lines) + [SCREEN.frame] * (1 + len(marks))
        strips = rr.LineStrips3D([*lines, *upright, *marks], colors=colours, radii=rr.Radius.ui_points(0.7))
        recording.log(f"{entity}/grid", strips, static=True)
        places, words = self._labels
        text = rr.Points3D(
            places,
            labels=words,
            show_labels=True,
            colors=[SCREEN.frame] * (len(words) - 3) + [SCREEN.text] * 3,
            radii=rr.Radius.ui_points(0.0),
        )
        recording.log(f"{entity}/labels", text, static=True)

    def eye(self) -> rrb.EyeControls3D:
        """Look at everything from in front, from the right and from above, its labels in sight."""
        corners = np.array(
            [(x, y, self.low[2]) for x in (self.low[0], self.high[0]) for y in (self.low[1], self.high[1])]
        )
        return fitting_eye(np.concatenate([self.seen, corners, self._labels[0]]))

    @cached_property
    def _labels(self) -> tuple[Float[np.ndarray, "labels 3"], list[str]]:
        """The places and words of ticks, the names of the three axes last."""
        (x0, y0, z0), (x1, y1, z1) = self.low, self.high
        inner = (self._ticks(axis)[1:-1] for axis in range(2))
        x, y = (ticks[:: 2 if len(ticks) > SCENES.ground_ticks else 1] for ticks in inner)
        z = self._ticks(2)[1:]
        gap = 0.07 * float((self.high - self.low).max())
        places = [(a, y0 - gap, z0) for a in x] + [(x1 + gap, b, z0) for b in y]
        places += [(x0 - gap, y0 - 0.3 * gap, c) for c in z]
        places += [((x0 + x1) / 2, y0 - 2.6 * gap, z0), (x1 + 2.6 * gap, (y0 + y1) / 2, z0), (x0, y0, z1 + gap)]
        return np.array(places), [*map(tick_text, (*x, *y, *z)), *self.labels]

    def _ticks(self, axis: int) -> np.ndarray:
        count = round((self.high[axis] - self.low[axis]) / self.step)
        return np.round(self.low[axis] + self.step * np.arange(count + 1), 9) + 0.0

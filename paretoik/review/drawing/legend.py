"""The legend of a recording: what is drawn in which colour, in a strip above everything else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.drawing.drawn_axes import TEXT, labels, text_width
from paretoik.review.drawing_options import VIEWS
from paretoik.review.palette import SCREEN, Colour

BULLET = "● "


@dataclass(frozen=True, kw_only=True)
class Legend:
    """Words and the colours of what they name, at ``entity``, in rows so many pixels wide."""

    entity: str
    entries: Sequence[tuple[str, Colour]]
    width: float = VIEWS.width

    def view(self) -> rrb.View:
        """Return the strip."""
        bounds = rrb.VisualBounds2D(x_range=[0.0, self.width], y_range=[0.0, self.height])
        return rrb.Spatial2DView(
            origin=self.entity, name="legend", titlebar=False, visual_bounds=bounds, background=SCREEN.background
        )

    @property
    def height(self) -> float:
        """How high the strip is [pixels]."""
        return self._row * (1 + max(row for row, _ in self._places()))

    def log(self, recording: rr.RecordingStream) -> None:
        """Draw the words, for all times."""
        words = [BULLET + word for word, _ in self.entries]
        middles = [
            (x + 0.5 * text_width(word), (row + 0.5) * self._row)
            for word, (row, x) in zip(words, self._places(), strict=True)
        ]
        colours = [colour for _, colour in self.entries]
        recording.log(f"{self.entity}/words", labels(words, np.array(middles), colours), static=True)

    @property
    def _row(self) -> float:
        return 1.5 * TEXT.line

    def _places(self) -> list[tuple[int, float]]:
        """Return the row of each entry, and where it begins."""
        places, row, x = list[tuple[int, float]](), 0, 24.0
        for word, _ in self.entries:
            width = text_width(BULLET + word) + 36.0  # wider than needed, for smaller windows
            if x + width > self.width and x > 24.0:
                row, x = row + 1, 24.0
            places.append((row, x))
            x += width
        return places

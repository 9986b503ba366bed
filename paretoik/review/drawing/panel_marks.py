"""What else a panel of two objectives shows: the bounds ε of a step of a sweep, and where refined points came from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from paretoik.arrays import Objectives, Values
from paretoik.review.drawing.drawn_axes import Canvas
from paretoik.review.palette import SCREEN


def log_epsilon(
    recording: rr.RecordingStream,
    entity: Sequence[str],
    canvas: Canvas,
    epsilon: Values | None,
    names: tuple[str, str],
    maximised: tuple[bool, bool],
) -> None:
    """Draw the finite bounds of the two objectives of a panel at the current time; none where ``epsilon`` is None."""
    strips, words = list[np.ndarray](), list[str]()
    for axis in range(2) if epsilon is not None else ():
        assert epsilon is not None
        bound = epsilon[axis]
        if not (np.isfinite(bound) and canvas.low[axis] <= bound <= canvas.high[axis]):
            continue
        line = np.stack([canvas.low, canvas.high])
        line[:, axis] = bound
        strips.append(canvas.place(line))
        words.append(f"ε: {names[axis]} {'≥' if maximised[axis] else '≤'} {bound:.4g}")
    lines = rr.LineStrips2D(
        strips,
        colors=SCREEN.epsilon,
        radii=rr.Radius.ui_points(1.0),
        labels=words,
        show_labels=True,
        draw_order=0.5,
    )
    recording.log(list(entity), lines)


def log_moves(
    recording: rr.RecordingStream,
    entity: Sequence[str],
    canvas: Canvas,
    origins: Objectives | None,
    front: Objectives,
) -> None:
    """Draw an arrow from where each point (points, 2) was to where it is, at the current time; none without origins."""
    origins = front[:0] if origins is None else origins
    seen = canvas.shows(origins) & canvas.shows(front[: len(origins)])
    tails, tips = canvas.place(origins[seen]), canvas.place(front[: len(origins)][seen])
    arrows = rr.Arrows2D(
        origins=tails, vectors=tips - tails, colors=SCREEN.moves, radii=rr.Radius.ui_points(0.8), draw_order=1.5
    )
    recording.log(list(entity), arrows)

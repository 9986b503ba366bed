"""What is recorded of a tool path: where the tool is when, and where it should be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Times


@dataclass(frozen=True, kw_only=True, eq=False)
class PathScene:
    """The scene of a tool path from ``start`` to ``target`` (task,) [m]; ``title`` says of what it is."""

    drawn_by: ClassVar[str] = "paretoik.review.drawing.whole_recording:WholeRecording"
    finished_by: ClassVar[str] = "paretoik.review.drawing.finished_path:FinishedPath"
    title: str
    start: Float[np.ndarray, " task"]
    target: Float[np.ndarray, " task"]


@dataclass(frozen=True, kw_only=True, eq=False)
class PathEnd:
    """Positions of the ``tool`` [m] at ``times`` [s], the ``reference`` that it follows, if any, and its ``target``.

    ``provenance`` is that of the run.
    """

    times: Times
    tool: Float[np.ndarray, "n task"]
    reference: Float[np.ndarray, "n task"] | None
    target: Float[np.ndarray, " task"]
    provenance: Mapping[str, Any]

    @property
    def middles(self) -> Times:
        """Times in the middle between samples [s]."""
        return (self.times[1:] + self.times[:-1]) / 2

    @property
    def speed(self) -> Float[np.ndarray, " _"]:
        """Mean speed of the tool between samples [m/s]; 0 if it stays where it is."""
        way, steps = np.linalg.norm(np.diff(self.tool, axis=0), axis=1), np.diff(self.times)
        return np.divide(way, steps, out=np.zeros_like(way), where=steps > 0)

    @property
    def distance(self) -> Float[np.ndarray, " n"]:
        """Distance of the tool from its target [m]."""
        return np.asarray(np.linalg.norm(self.tool - self.target, axis=1))

"""The surfaces of links in space, translucent: what obstacles must stay clear of, and what runs inside can be seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import Float

from paretoik.review.drawing.obstacle_drawing import turn_of_z
from paretoik.review.drawing_options import SCENES
from paretoik.review.palette import SCREEN


@dataclass(frozen=True, kw_only=True)
class LinkHulls:
    """Capsules of a ``radius`` [m] around links: their lines alone are never hidden by them."""

    radius: float

    def send(
        self,
        recording: rr.RecordingStream,
        entity: str,
        columns: Sequence[rr.TimeColumn],
        links: Float[np.ndarray, "rows nodes 3"],
    ) -> None:
        """Draw the links of each posture, a row of ``columns`` each."""
        self._log_style(recording, entity)
        capsules = _capsules(links)
        per_row = [len(capsules["lengths"]) // len(links)] * len(links)
        recording.send_columns(entity, columns, rr.Capsules3D.columns(**capsules).partition(per_row))

    def log_posture(self, recording: rr.RecordingStream, entity: str, links: Float[np.ndarray, "nodes 3"]) -> None:
        """Draw the links of a posture at the current time."""
        self._log_style(recording, entity)
        recording.log(entity, rr.Capsules3D.from_fields(**_capsules(links[None])))

    def _log_style(self, recording: rr.RecordingStream, entity: str) -> None:
        style = rr.Capsules3D.from_fields(
            radii=[self.radius], colors=[SCREEN.hull], fill_mode=rr.components.FillMode.Solid
        )
        recording.log(entity, style, static=True)


def _capsules(links: Float[np.ndarray, "rows nodes 3"]) -> dict[str, Any]:
    """Return the fields of the capsules of all rows, those of one posture after those of the one before."""
    axes = np.diff(links, axis=1)
    lengths = np.linalg.norm(axes, axis=2)
    is_link = (lengths > SCENES.shortest * lengths.max()).any(axis=0)
    return {
        "lengths": lengths[:, is_link].ravel(),
        "translations": links[:, :-1][:, is_link].reshape(-1, 3),
        "quaternions": np.array([turn_of_z(axis) for axis in axes[:, is_link].reshape(-1, 3)]),
    }

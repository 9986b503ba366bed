"""What the folder of directional maxima shows: a recording, and a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from paretoik.api.run_session import RunSession
from paretoik.capability.directional import DirectionalQuery, PerformancePolygon
from paretoik.review.recording.measured_maxima import MaximaScene, maxima_end
from paretoik.review.recording.workcell import workcell_of
from paretoik.run_files import DRAWING


def start_recording(query: DirectionalQuery, session: RunSession) -> None:
    """Start the recording of what is asked for."""
    cell = workcell_of(query)
    assert cell is not None
    alone = replace(cell, directions=np.zeros((0, 3)))  # one after the other
    session.start_recording(MaximaScene(workcell=alone, quantity=query.quantity))


def review_polygon(polygon: PerformancePolygon, provenance: Mapping[str, Any], session: RunSession) -> None:
    """Complete the recording, and, unless a signal came, draw the polygon."""
    if session.folder is None:
        return
    session.finish_recording(maxima_end(polygon, provenance))
    if session.signal is not None:
        return
    from paretoik.review.pictures.polygon_picture import polygon_picture  # here: matplotlib takes its time

    polygon_picture(polygon, session.folder / DRAWING)

"""What the folder of directional maxima shows: a picture."""

from __future__ import annotations

from paretoik.api.run_session import RunSession
from paretoik.capability.directional import PerformancePolygon
from paretoik.run_files import DRAWING


def review_polygon(polygon: PerformancePolygon, session: RunSession) -> None:
    """Draw the polygon, unless a signal came."""
    if session.folder is None or session.signal is not None:
        return
    from paretoik.review.polygon_picture import polygon_picture  # here: matplotlib takes its time

    polygon_picture(polygon, session.folder / DRAWING)

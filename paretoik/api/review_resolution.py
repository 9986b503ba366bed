"""What the folder of a resolved motion shows: a picture."""

from __future__ import annotations

from paretoik.api.run_session import RunSession
from paretoik.resolution.resolve import Resolution
from paretoik.resolution.traces import ResolvedMotion
from paretoik.run_files import DRAWING


def review_resolution(motion: ResolvedMotion, resolution: Resolution, session: RunSession) -> None:
    """Draw the first of the motions."""
    if session.folder is None:
        return
    from paretoik.review.resolution_picture import resolution_picture  # here: matplotlib takes its time

    while motion.q.ndim > 2:
        motion = motion[0]
    resolution_picture(motion, [each.objective.name for each in resolution.criteria], session.folder / DRAWING)

"""What the folder of a resolved motion shows: a recording, and a picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from paretoik.api.run_session import RunSession
from paretoik.errors import Infeasible
from paretoik.resolution.resolve import Resolution, resolve
from paretoik.resolution.traces import ResolvedMotion
from paretoik.review.recording.resolved import ResolutionEnd, ResolvedScene, record_traces
from paretoik.review.recording.workcell import workcell_of
from paretoik.run_files import DRAWING
from paretoik.task.task import error_unit


def resolve_recorded(resolution: Resolution, session: RunSession) -> ResolvedMotion:
    """Return the motion that is asked for, while a recording is begun; where the path is lost, record how far it goes.

    Raises what ``resolution.resolve`` does.
    """
    cell = workcell_of(resolution)
    assert cell is not None
    scene = ResolvedScene(
        workcell=cell,
        method=type(resolution.method).__name__,
        criteria=tuple(each.objective.name for each in resolution.criteria),
        tolerance=float(resolution.tolerance),
        error_unit=error_unit(resolution.task.tasks),
        min_clearance=float(resolution.task.min_clearance),
    )
    session.start_recording(scene)
    try:
        return resolve(resolution)
    except Infeasible as lost:
        if isinstance(lost.motion, ResolvedMotion):
            ending = {"status": "the path is lost", "reason": str(lost)}
            _finish_recording(lost.motion, {**session.provenance, **ending}, session)
        raise


def _finish_recording(motion: ResolvedMotion, provenance: Mapping[str, Any], session: RunSession) -> None:
    if session.recorder is not None:
        motions, count = record_traces(motion)
        session.finish_recording(ResolutionEnd(motions=motions, count=count, provenance=provenance))


def review_resolution(motion: ResolvedMotion, resolution: Resolution, session: RunSession) -> None:
    """Complete the recording, and draw the first of the motions."""
    if session.folder is None:
        return
    _finish_recording(motion, {**session.provenance, "status": "resolved"}, session)
    from paretoik.review.pictures.resolution_picture import resolution_picture  # here: matplotlib takes its time

    while motion.q.ndim > 2:
        motion = motion[0]
    resolution_picture(motion, [each.objective.name for each in resolution.criteria], session.folder / DRAWING)

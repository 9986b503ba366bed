"""What a search comes to that has found nothing feasible: the least-violating individual, and what it breaks."""

from __future__ import annotations

import numpy as np

from paretoik.errors import Infeasible
from paretoik.formulations.protocol import decode, explain_violation, violation_words
from paretoik.review.recording.recorded_point import RecordedPoint, record_motion
from paretoik.review.recording.recorder import LeastViolating
from paretoik.search.ask_tell import Search
from paretoik.search.islands import Islands


def infeasible_error(search: Search | Islands) -> Infeasible:
    """Return the error of a search without a feasible point, with the least-violating motion and what it breaks."""
    nearest = search.archive.least_violating
    if nearest is None:
        return Infeasible(f"no feasible point in {search.evaluations} evaluations, and none without a failure")
    limit, reason = explain_violation(search.problem, nearest.X, nearest.G[0])
    motions = decode(search.problem, nearest.X)
    return Infeasible(
        f"no motion within the limits in {search.evaluations} evaluations; of the least-violating one, {reason}",
        motion=None if motions is None else motions[0],
        limit=limit,
        violation=float(nearest.G.max()),
    )


def least_violating(search: Search | Islands, failure: Infeasible | None = None) -> LeastViolating | None:
    """Return what a recording shows of the least-violating individual so far, at the end with the error and its motion.

    None as soon as there is a feasible point, and where all evaluations failed.
    """
    nearest = search.archive.least_violating
    if nearest is None:
        return None
    broken = violation_words(search.problem, nearest.G[0])
    if failure is None:
        return LeastViolating(broken=broken)
    objectives = nearest.F[0] * np.where(search.maximised, -1.0, 1.0)
    motion = record_motion(failure.motion, curves=True)
    point = RecordedPoint(id=int(nearest.ids[0]), objectives=objectives, motion=motion)
    return LeastViolating(broken=broken, reason=str(failure), point=point)

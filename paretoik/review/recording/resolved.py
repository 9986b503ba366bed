"""What is recorded of motions that a method resolved: each with what happened at every step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float, Shaped

from paretoik.arrays import Times
from paretoik.resolution.traces import ResolvedMotion
from paretoik.review.drawing_options import DRAWING
from paretoik.review.even_rows import even_rows
from paretoik.review.recording.recorded_point import RecordedPoint, record_motion
from paretoik.review.recording.workcell import Workcell
from paretoik.robot.kinematics import link_nodes
from paretoik.task.distances import clearance

NO_OBJECTIVES = np.zeros(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ResolvedScene:
    """The scene of resolved motions: where they are drawn, the method by its name, and its criteria by theirs.

    ``tolerance`` is the error at which the path counts as lost, ``error_unit`` that of both; ``min_clearance`` [m] is
    what links are to keep.
    """

    drawn_by: ClassVar[str] = "paretoik.review.drawing.whole_recording:WholeRecording"
    finished_by: ClassVar[str] = "paretoik.review.drawing.finished_resolution:FinishedResolution"
    workcell: Workcell
    method: str
    criteria: tuple[str, ...]
    tolerance: float
    error_unit: str
    min_clearance: float


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedTraces:
    """A resolved motion as a ``point``, its id the place in its batch, and what its method did.

    ``error`` is the largest at each sample, ``clearance`` [m] None without obstacles. Over each step to the sample
    after it: ``speed``, the length of the commanded joint velocities, ``damping``, ``repulsion``, the length of the
    velocities away from limits, ``criteria`` those of each criterion, and ``status`` in a word.
    """

    name: str
    point: RecordedPoint
    error: Float[np.ndarray, " time"]
    clearance: Float[np.ndarray, " time"] | None
    speed: Float[np.ndarray, " steps"]
    damping: Float[np.ndarray, " steps"]
    repulsion: Float[np.ndarray, " steps"]
    criteria: Float[np.ndarray, "steps criteria"]
    status: Shaped[np.ndarray, " steps"]

    @property
    def time(self) -> Times:
        """Times of the samples [s]."""
        assert self.point.motion is not None
        return self.point.motion.time


@dataclass(frozen=True, kw_only=True, eq=False)
class ResolutionEnd:
    """Resolved motions, at least one and maybe not all of ``count``, and the ``provenance`` of their run."""

    motions: Sequence[RecordedTraces]
    count: int
    provenance: Mapping[str, Any]


def record_traces(motion: ResolvedMotion) -> tuple[list[RecordedTraces], int]:
    """Return the motions of a batch, evenly spread ones of many, and how many there are."""
    batch = list(np.ndindex(motion.q.shape[:-2]))
    places = even_rows(len(batch), DRAWING.walk).tolist()
    return [_recorded(motion[batch[place]] if batch[place] else motion, place, batch[place]) for place in places], len(
        batch
    )


def _recorded(motion: ResolvedMotion, place: int, index: tuple[int, ...]) -> RecordedTraces:
    traces, obstacles = motion.traces, motion.obstacles
    distance = clearance(obstacles, link_nodes(motion.arm, motion.q), motion.link_radius) if obstacles else None
    return RecordedTraces(
        name=f"motion {', '.join(map(str, index))}" if index else "the motion",
        point=RecordedPoint(id=place, objectives=NO_OBJECTIVES, motion=record_motion(motion, curves=True)),
        error=np.abs(traces.errors).max(axis=-1),
        clearance=None if distance is None else np.asarray(distance),
        speed=np.linalg.norm(traces.velocities, axis=-1),
        damping=traces.damping,
        repulsion=np.linalg.norm(traces.repulsion, axis=-1),
        criteria=np.linalg.norm(traces.projected, axis=-1),
        status=traces.status,
    )

"""What is recorded and drawn of a plan: its levels, and its optima."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Times
from paretoik.review.recording.least_violating import LeastViolating
from paretoik.review.recording.recorded_point import RecordedPoint
from paretoik.review.recording.workcell import Workcell


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedMotions:
    """The motions of a level, at ``time`` [s]: those that it started from, what they led to, and the distinct optima.

    ``optimum`` is the optimum that each start led to, by its place, −1 where it led to none of them.
    """

    time: Times
    starts: Float[np.ndarray, "starts time dof"]
    ends: Float[np.ndarray, "starts time dof"]
    optima: Float[np.ndarray, "optima time dof"]
    optimum: Int[np.ndarray, " starts"]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedLevel:
    """A level of ``samples`` that is done, the ``number``-th from 0: the objective of its starts, and of its optima.

    Values are in the objective's own sign, of the optima best first; ``ends`` are those of what the starts led to, NaN
    where that is no optimum. Where no motion of the level keeps all limits, its optima are the least-violating ones,
    and ``least_violating`` says what the first of them breaks.
    """

    number: int
    samples: int
    starts: Float[np.ndarray, " starts"]
    ends: Float[np.ndarray, " starts"]
    optima: Float[np.ndarray, " optima"]
    motions: PlannedMotions
    least_violating: LeastViolating | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedScene:
    """The scene of a plan: its objective's name, unit and sense, and where its motions are drawn."""

    drawn_by: ClassVar[str] = "paretoik.review.drawing.whole_recording:WholeRecording"
    finished_by: ClassVar[str] = "paretoik.review.drawing.finished_plan:FinishedPlan"
    name: str
    unit: str
    maximised: bool
    workcell: Workcell
    timeline: str = "level"


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedOptimum:
    """An optimum of a plan as a ``point``, whose id is its place, and what is said of it."""

    point: RecordedPoint
    branch: str
    status: str
    violation_between: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanEnd:
    """The optima of a plan, best first, and the ``provenance`` of its run.

    Without an optimum, ``least_violating`` is the motion that comes nearest to keeping all limits.
    """

    optima: Sequence[PlannedOptimum] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    least_violating: LeastViolating | None = None

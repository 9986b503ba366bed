"""The time that certificates take: how long a verb will still take, and what its time limit leaves for them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.api.time_left import OPTIONS as TIME_LEFT
from paretoik.api.time_left import time_left
from paretoik.arrays import Point, Points
from paretoik.compilation_notices import computing_clock
from paretoik.distribution import workers
from paretoik.errors import ParetoikError
from paretoik.execution.time_limit import reserve_time
from paretoik.formulations.protocol import Differentiable, task_of
from paretoik.journal import without_journal
from paretoik.nlp.program import Program, Solver
from paretoik.pareto.certificates import certify
from paretoik.pareto.sweep import SweepProgress
from paretoik.task.limits import LIMIT_TOLERANCE


@dataclass(frozen=True, kw_only=True)
class CertificateTime:
    """Settings of the time that certificates, and so tightening limits, have.

    share: share of a time limit
    longest: most seconds of a time limit a point
    trials: share of the time so far that trials of later stages may take
    spread: share of a front between points that are tried, the golden ratio: any number of steps spreads evenly
    """

    share: float = 0.2
    longest: float = 2.0
    trials: float = 0.1
    spread: float = 0.618


OPTIONS = CertificateTime()


@dataclass(frozen=True, kw_only=True)
class LaterStages:
    """What follows once the points of a front are there: ``tightening`` of limits if there are any, certification."""

    tightening: bool = False

    @classmethod
    def of(cls, problem: Any) -> LaterStages:
        """Return the stages of a problem: limits between samples are tightened of splines."""
        task = task_of(problem)
        return cls(tightening=task is not None and task.differences == "spline")

    @property
    def text(self) -> str:
        """The stages in words."""
        return "tightening and certification" if self.tightening else "certification"

    def reserve(self, points: int) -> AbstractContextManager[None]:
        """Return a context that ends before the time limit under way, so that the points found in it have them too."""
        count = 2 if self.tightening else 1
        return reserve_time(count * OPTIONS.share, count * points * OPTIONS.longest)


@dataclass(kw_only=True, eq=False)
class LaterTime:
    """How long the later stages of a formulation's points take, measured on some points as they come.

    looks: seconds of each look at whether a point exceeds limits between samples
    tightenings: seconds of each tightening of a point that does
    certificates: seconds of each certification
    exceeding: number of points looked at that exceed limits
    seen: points looked at
    spent: seconds that all of this took
    after_cold: seconds of a sweep and its levels when its last cold start was done
    """

    formulation: Differentiable
    solver: Solver = "auto"
    looks: list[float] = field(default_factory=list)
    tightenings: list[float] = field(default_factory=list)
    certificates: list[float] = field(default_factory=list)
    exceeding: int = 0
    seen: set[bytes] = field(default_factory=set)
    spent: float = 0.0
    after_cold: tuple[float, int] | None = None

    def per_point(self) -> float:
        """Return the seconds that both stages take a point, as many at a time as there are workers."""
        share = self.exceeding / max(len(self.looks), 1)
        tightening = _mean(self.looks) + share * _mean(self.tightenings)
        return tightening / max(workers(), 1) + self.per_certificate()

    def per_certificate(self) -> float:
        """Return the seconds that certification takes a point, as many at a time as there are workers."""
        return _mean(self.certificates) / max(workers(), 1)

    def try_point(self, x: Point, ranges: Float[np.ndarray, " n_obj"], seconds: float) -> None:
        """Look whether a point exceeds limits, and take it through both stages, if trials take little of ``seconds``.

        Which points are tried depends on the clock, so that a run's journal has nothing of it.
        """
        key = x.tobytes()
        if key in self.seen or seconds < TIME_LEFT.seconds or sum(self.looks) > OPTIONS.trials * seconds:
            return
        self.seen.add(key)
        clock = [computing_clock()]

        def lap() -> float:
            clock.append(computing_clock())
            return clock[-1] - clock[-2]

        with suppress(ParetoikError), without_journal():
            exceeds = self.formulation.individuals(x[None]).violation_between[0] > LIMIT_TOLERANCE
            self.looks.append(lap())
            self.exceeding += int(exceeds)
            is_first = not (self.tightenings if exceeds else self.certificates)
            if is_first or (exceeds and self.spent <= OPTIONS.trials * seconds):
                held, programs = self.formulation.hold_between(x[None], ranges, solver=self.solver)
                self.tightenings += [lap()] if exceeds else []
                if not self.certificates:  # the first one loads much
                    self._certify(programs, held, 2 * ranges)
                lap()
                self._certify(programs, held, ranges)
                self.certificates.append(lap())
        self.spent += computing_clock() - clock[0]

    def _certify(self, programs: Sequence[Program], x: Points, ranges: Float[np.ndarray, " n_obj"]) -> None:
        between = self.formulation.individuals(x).violation_between
        certify(programs, x, ranges=ranges, signs=np.ones(len(ranges)), violation_between=between)

    def sweep_left(self, progress: SweepProgress, seconds: float) -> float | None:
        """Return about how many seconds are left of a sweep that has taken so many, with later stages.

        It is None if that is not known.
        """
        if progress.ahead is None:
            return None
        row = int(len(progress.front) * (OPTIONS.spread * len(self.looks) % 1))
        self.try_point(progress.x[progress.front[row]], progress.ranges, seconds)
        seconds -= self.spent
        self.after_cold = self.after_cold or (seconds, progress.solved)
        began, solved = self.after_cold
        later = progress.total * self.per_point()
        return time_left(progress.solved - solved, progress.ahead, seconds - began, later) if self.looks else None


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else 0.0

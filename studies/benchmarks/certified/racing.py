"""Seconds a point: ours beside those of IPOPT and FATROP, which solve the same ε-problems from neighbouring points."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from studies.benchmarks.certified.cases import HOLDS, Subject
from studies.benchmarks.certified.dominating import DOMINATED, led_back, objectives, violation
from studies.benchmarks.certified.staged import StagedProgram
from studies.benchmarks.fronts.programs import JointProgram
from studies.benchmarks.planner.verdicts import versus
from studies.reporting import Row

REACHED = 1e-6  # of the ranges: what is that near our point, or better, has reached it
GOAL = 1.0


@dataclass(frozen=True, kw_only=True)
class Solved:
    """A peer's seconds on one ε-problem, whether it reached our point, and what it gained where nothing has risen."""

    seconds: float
    reached: bool
    gain: float


def race_rows(subject: Subject) -> list[Row]:
    """Return what peers better, and our seconds a point beside their median and all of theirs over points reached."""
    peers = {"IPOPT": subject.peer} | ({"FATROP": subject.staged} if subject.staged is not None else {})
    return [row for name, peer in peers.items() for row in _against(subject, name, peer)]


def _against(subject: Subject, name: str, peer: JointProgram | StagedProgram) -> list[Row]:
    tries = [solved_by(peer, subject, point) for point in range(len(subject.q))]
    ours, reached = subject.seconds / len(subject.q), sum(one.reached for one in tries)
    every = sum(one.seconds for one in tries)
    theirs = {
        "median": float(np.median([one.seconds for one in tries])),
        "all over points reached": every / reached if reached else np.inf,
    }
    note = (
        f"{len(subject.q)} points in {subject.seconds:.1f} s (processor {subject.cpu:.1f} s); {name} {every:.1f} s, "
        f"reaches {reached} of them"
    )
    better = Row(
        table=subject.name,
        row=f"{name} from neighbours",
        column="largest gain, no loss",
        unit="share of range",
        ours=max(one.gain for one in tries),
        note=f"{sum(one.gain > DOMINATED for one in tries)} points beaten",
    )
    return [
        better,
        *(
            versus(
                table=subject.name,
                row="seconds a point",
                column=f"beside {name}'s {which}",
                unit="s",
                ours=ours,
                theirs=seconds,
                goal=GOAL,
                note=note,
            )
            for which, seconds in theirs.items()
        ),
    ]


def solved_by(peer: JointProgram | StagedProgram, subject: Subject, point: int) -> Solved:
    """Return what a peer makes of a point's ε-problem, from the nearest other point and, should it fail, once more."""
    shares = subject.values / subject.ranges
    apart = np.linalg.norm(shares - shares[point], axis=1)
    apart[point] = np.inf
    main, start = int(subject.said.weights[point].argmax()), subject.q[int(apart.argmin())]
    ceilings = np.where(np.arange(len(subject.ranges)) == main, np.inf, subject.values[point])
    begun = time.perf_counter()
    for warm in (True, False):
        made, _ = peer.solve(start, main, ceilings, subject.ranges, warm=warm)
        if made is not None:
            break
    seconds = time.perf_counter() - begun
    found = None if made is None else led_back(subject.task, made)
    if found is None or violation(subject.task, found) > HOLDS:
        return Solved(seconds=seconds, reached=False, gain=0.0)
    rise = (objectives(subject.task, found) - subject.values[point]) / subject.ranges
    gain = -float(rise.min()) if rise.max() <= 0 else 0.0
    return Solved(seconds=seconds, reached=bool(rise.max() <= REACHED), gain=gain)

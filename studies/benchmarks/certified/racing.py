"""Seconds a point: ours beside those of IPOPT, which solves the same ε-problems from neighbouring points."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from studies.benchmarks.certified.cases import HOLDS, Known
from studies.benchmarks.certified.dominating import led_back, objectives, violation
from studies.benchmarks.planner.verdicts import versus
from studies.reporting import Row

REACHED = 1e-6  # of the ranges: what is that near our point, or better, has reached it
GOAL = 1.0


@dataclass(frozen=True, kw_only=True)
class Solved:
    """IPOPT's seconds on one ε-problem, and whether it reached the point that ours is."""

    seconds: float
    reached: bool


def race_rows(front: Known) -> list[Row]:
    """Return our seconds a point beside IPOPT's: the median, and all of them over the points that it reached."""
    tries = [ipopt_solve(front, point) for point in range(len(front.q))]
    ours, reached = front.seconds / len(front.q), sum(one.reached for one in tries)
    every = sum(one.seconds for one in tries)
    theirs = {
        "median": float(np.median([one.seconds for one in tries])),
        "all over points reached": every / reached if reached else np.inf,
    }
    note = (
        f"{len(front.q)} points in {front.seconds:.1f} s (processor {front.cpu:.1f} s); IPOPT {every:.1f} s, reaches "
        f"{reached} of them"
    )
    return [
        versus(
            table=front.name,
            row="seconds a point",
            column=f"beside IPOPT's {name}",
            unit="s",
            ours=ours,
            theirs=seconds,
            goal=GOAL,
            note=note,
        )
        for name, seconds in theirs.items()
    ]


def ipopt_solve(front: Known, point: int) -> Solved:
    """Return what IPOPT makes of a point's ε-problem, from the nearest other point and, should it fail, once more."""
    said = front.front.certificates
    assert said is not None
    shares = front.values / front.ranges
    apart = np.linalg.norm(shares - shares[point], axis=1)
    apart[point] = np.inf
    main, start = int(said.weights[point].argmax()), front.q[int(apart.argmin())]
    ceilings = np.where(np.arange(len(front.ranges)) == main, np.inf, front.values[point])
    begun = time.perf_counter()
    for warm in (True, False):
        made, _ = front.peer.solve(start, main, ceilings, front.ranges, warm=warm)
        if made is not None:
            break
    seconds = time.perf_counter() - begun
    found = None if made is None else led_back(front.task, made)
    if found is None or violation(front.task, found) > HOLDS:
        return Solved(seconds=seconds, reached=False)
    rise = (objectives(front.task, found) - front.values[point]) / front.ranges
    return Solved(seconds=seconds, reached=bool(rise.max() <= REACHED))

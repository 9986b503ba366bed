"""Seconds per point: ours, and those of IPOPT and FATROP on the same ε-problems from neighbouring points.

Ours are those of the whole front, found without a start and certified. A peer's are one solve per point, from our
neighbouring point. One of our own solves from there is reported separately.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from paretoik.nlp.minimise import minimise
from paretoik.pareto.sweep import OPTIONS as EPSILON
from studies.benchmarks.certified.attacks import DOMINATED, led_back, objectives, violation
from studies.benchmarks.certified.cases import HOLDS, Subject
from studies.benchmarks.peers.solvers import COLD, WARM, Peer
from studies.reporting import Row, versus

REACHED = 1e-6  # of the ranges: a result this near our point, or better, has reached it
GOAL = 1.0


@dataclass(frozen=True, kw_only=True)
class Solved:
    """Seconds on one ε-problem, whether it reached our point, and its gain if no objective has risen."""

    seconds: float
    reached: bool
    gain: float


def race_rows(subject: Subject) -> list[Row]:
    """Return the peers' gains, and our seconds per point and per solve compared with theirs."""
    peers = {"IPOPT": subject.peer} | ({"FATROP": subject.staged} if subject.staged is not None else {})
    own_solves = [solved_by_us(subject, point) for point in range(len(subject.q))]
    return [row for name, peer in peers.items() for row in _against(subject, name, peer, own_solves)]


def _against(subject: Subject, name: str, peer: Peer, own_solves: list[Solved]) -> list[Row]:
    tries = [solve_by(peer, subject, point) for point in range(len(subject.q))]
    ours, theirs = subject.seconds / len(subject.q), sum(one.seconds for one in tries)
    note = (
        f"{len(subject.q)} points in {subject.seconds:.1f} s (processor {subject.cpu:.1f} s); {name} {theirs:.1f} s, "
        f"reaches {_points_reached(tries)} of them"
    )
    solves = f"ours reach {_points_reached(own_solves)} of {len(own_solves)}"
    a_point, one_solve, over = "seconds a point", "one solve from a neighbour", "all over points reached"
    middle, reached = _median(tries), _seconds_a_point(tries)
    gains = [one.gain for one in tries]
    place, beaten = f"{name} from neighbours", f"{sum(gain > DOMINATED for gain in gains)} points beaten"
    table, mine = subject.name, _median(own_solves)
    return [
        Row(table, place, "largest gain, no loss", "share of range", max(gains), note=beaten),
        versus(table, a_point, f"beside {name}'s median", "s", ours, middle, goal=GOAL, note=note),
        versus(table, a_point, f"beside {name}'s {over}", "s", ours, reached, goal=GOAL, note=note),
        versus(table, one_solve, f"beside {name}, medians", "s", mine, middle, note=solves),
        versus(table, one_solve, f"beside {name}, {over}", "s", _seconds_a_point(own_solves), reached),
    ]


def _median(tries: list[Solved]) -> float:
    return float(np.median([one.seconds for one in tries]))


def _points_reached(tries: list[Solved]) -> int:
    return sum(one.reached for one in tries)


def _seconds_a_point(tries: list[Solved]) -> float:
    """Return the seconds of all, divided by the points reached."""
    return sum(one.seconds for one in tries) / _points_reached(tries) if _points_reached(tries) else np.inf


def solve_by(peer: Peer, subject: Subject, point: int) -> Solved:
    """Return a peer's result on a point's ε-problem, from the nearest other point and, if that fails, once more."""
    main, start, ceilings = _epsilon_problem(subject, point)
    started = time.perf_counter()
    for settings in (WARM, COLD):
        motion = peer.solve(start, main, ceilings, subject.ranges, settings).motion
        if motion is not None:
            break
    return _record(subject, point, motion, time.perf_counter() - started)


def solved_by_us(subject: Subject, point: int) -> Solved:
    """Return our own solver's result on a point's ε-problem, by the same rules as peers."""
    main, start, ceilings = _epsilon_problem(subject, point)
    program, count = subject.program, len(subject.ranges)
    factors, caps = np.zeros((2, 1, len(program.totals)))
    factors[0, main] = 1.0
    caps[:] = np.inf
    caps[0, :count] = ceilings / subject.ranges
    started, motion = time.perf_counter(), None
    for rules in (EPSILON.warm, EPSILON.cold):
        solutions = minimise(program, start[None], factors, caps, rules)
        if solutions.converged[0]:
            motion = solutions.x[0]
            break
    return _record(subject, point, motion, time.perf_counter() - started)


def _epsilon_problem(subject: Subject, point: int) -> tuple[int, np.ndarray, np.ndarray]:
    """Return (objective to minimise, motion to start from, ceilings) of a point's ε-problem."""
    shares = subject.values / subject.ranges
    distances = np.linalg.norm(shares - shares[point], axis=1)
    distances[point] = np.inf
    main = int(subject.certificates.weights[point].argmax())
    ceilings = np.where(np.arange(len(subject.ranges)) == main, np.inf, subject.values[point])
    return main, subject.q[int(distances.argmin())], ceilings


def _record(subject: Subject, point: int, end: np.ndarray | None, seconds: float) -> Solved:
    motion = None if end is None else led_back(subject.task, end)
    if motion is None or violation(subject.task, motion) > HOLDS:
        return Solved(seconds=seconds, reached=False, gain=0.0)
    rise = (objectives(subject.task, motion) - subject.values[point]) / subject.ranges
    gain = -float(rise.min()) if rise.max() <= 0 else 0.0
    return Solved(seconds=seconds, reached=bool(rise.max() <= REACHED), gain=gain)

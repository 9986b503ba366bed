"""Attacks on a front: IPOPT and random steps within all limits from its points; exchange rates against solves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from paretoik.nlp.minimise import minimise
from paretoik.pareto.sweep import OPTIONS as EPSILON
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import retract_nearest
from paretoik.trajectory.motion_terms import MotionLinearisation, joint_distance
from paretoik.trajectory.tightening import violation_between
from studies.benchmarks.certified.cases import HOLDS, Subject
from studies.benchmarks.peers.solvers import COLD, WARM
from studies.reporting import Row, goal_row

DOMINATED = 1e-7  # of the ranges
ROUNDING = 1e-13  # of the ranges: a smaller rise does not count
AGAIN = 3  # repeats below lower ceilings
SIZES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)  # rad (RMS) of random steps
KNOTS = (4, 8, 16, 32)  # of their splines
ROUNDS = 6  # of Newton's steps back within the limits


class Attempt(NamedTuple):
    """An attempt on a point: its gain, a share of the ranges, −inf without one that counts; its distance [rad, RMS].

    ``ended`` says whether there is a motion.
    """

    point: int
    how: str
    ended: bool
    gain: float = -np.inf
    distance: float = np.nan

    @property
    def counts(self) -> bool:
        """Whether it satisfies the path, the limits and the ceilings."""
        return np.isfinite(self.distance)


def ipopt_rows(subject: Subject, *, barriers: Sequence[str]) -> list[Row]:
    """Return the largest gain of IPOPT from any point, no objective rising; ``barriers``: "low", "high"."""
    tries = [
        ipopt_attempt(subject, point, main, warm=barrier == "low")
        for point in range(len(subject.q))
        for main in range(len(subject.ranges))
        for barrier in barriers
    ]
    ended, counts = sum(one.ended for one in tries), sum(one.counts for one in tries)
    note = f"{len(tries)} runs, {ended} ended well, {counts} of them within ceilings and limits"
    place = subject.name, "IPOPT from every point", "largest gain, no loss", "share of range"
    gain = max(0.0, *(one.gain for one in tries))
    return [goal_row(*place, gain, DOMINATED, ", ".join([note, *_worst(tries)]))]


def ipopt_attempt(subject: Subject, point: int, main: int, *, warm: bool) -> Attempt:
    """Return IPOPT's gain when it minimises objective ``main`` below the point's own values of the others."""
    q, values, ranges = subject.q[point], subject.values[point], subject.ranges
    how = f"{subject.front.names[main]} minimised, barrier {'low' if warm else 'high'}"
    ceilings = np.where(np.arange(len(values)) == main, np.inf, values)
    for _ in range(AGAIN):
        end = subject.peer.solve(q, main, ceilings, ranges, WARM if warm else COLD).motion
        if end is None:
            return Attempt(point, how, False)
        motion = led_back(subject.task, end)
        if motion is None or violation(subject.task, motion) > HOLDS:
            return Attempt(point, how, True)
        between = subject.certificates.violation_between[point] + HOLDS  # a spline as well as the front's point
        if subject.task.differences == "spline" and violation_between(subject.task, motion) > between:
            return Attempt(point, how, True)
        rise = (objectives(subject.task, motion) - values) / ranges
        others = np.delete(rise, main)
        if others.max() <= ROUNDING:
            gain = float(-rise.min()) if rise.max() <= ROUNDING else -np.inf
            distance = float(joint_distance(subject.task, motion, q))
            return Attempt(point, how, True, gain, distance)
        ceilings = ceilings - 2 * np.maximum(rise, 0.0) * ranges
    return Attempt(point, how, True)


def perturbation_rows(subject: Subject, *, steps: int, seed: int) -> list[Row]:
    """Return the largest gain in all objectives at once of random feasible steps from any point."""
    rng = np.random.default_rng(seed)
    tries = [one for point in range(len(subject.q)) for one in perturbations(subject, point, steps, rng)]
    note = f"{len(tries)} steps, {sum(one.counts for one in tries)} within limits"
    place = subject.name, "random steps from every point", "largest gain of all", "share of range"
    return [goal_row(*place, max(one.gain for one in tries), DOMINATED, ", ".join([note, *_worst(tries)]))]


def perturbations(subject: Subject, point: int, steps: int, rng: np.random.Generator) -> list[Attempt]:
    """Return the gains of random smooth steps; every other one changes no objective to first order."""
    at = subject.program.linearise(subject.q[point])
    tries = []
    for k in range(steps):
        size, level = SIZES[k % len(SIZES)], bool(k // len(SIZES) % 2)
        how = f"a step of {size:g} rad" + (" that changes no objective to first order" if level else "")
        motion = within(at, random_step(at, size, rng), level=level)
        if motion is None:
            tries.append(Attempt(point, how, False))
            continue
        gain = float(((subject.values[point] - objectives(subject.task, motion)) / subject.ranges).min())
        distance = float(joint_distance(subject.task, motion, subject.q[point]))
        tries.append(Attempt(point, how, True, gain, distance))
    return tries


def random_step(at: MotionLinearisation, size: float, rng: np.random.Generator) -> np.ndarray:
    """Return a smooth random step of the self-motion, as unknowns, of a given length (RMS over time)."""
    samples, dof = at.x.shape
    knots = np.linspace(0.0, samples - 1.0, int(rng.choice(KNOTS)))
    smooth = CubicSpline(knots, rng.normal(size=(len(knots), dof)))(np.arange(samples))
    coordinates, place = np.einsum("tja,tj->ta", at.normal, smooth), at.program.stencil.first_unknown
    step, free = np.zeros(at.unknowns), place >= 0
    step[place[free, None] + np.arange(coordinates.shape[1])] = coordinates[free]
    moved = at.displacement(step)
    return step * (size / np.sqrt(np.mean(np.sum(moved**2, axis=1))))


def within(at: MotionLinearisation, step: np.ndarray, *, level: bool) -> np.ndarray | None:
    """Return the motion after a step, bent back within the limits; None if that fails."""
    task, short = at.program.task, np.zeros(at.elastic, dtype=bool)
    flat = at.gradients[: len(at.gradients) * level, : at.unknowns]  # a peak has no first order
    step = step - np.linalg.pinv(flat) @ (flat @ step) if level else step
    for _ in range(ROUNDS):
        motion = led_back(task, at.x + at.displacement(step))
        if motion is None:
            return None
        if violation(task, motion) <= HOLDS:
            return motion
        gaps = at.program.evaluate(motion)[2]
        short |= gaps < 0
        rows = np.concatenate([at.jacobian[np.flatnonzero(short)].toarray()[:, : at.unknowns], flat])
        step = step + np.linalg.lstsq(rows, np.concatenate([-gaps[short], np.zeros(len(flat))]))[0]
    return None


def led_back(task: MotionTask, q: np.ndarray) -> np.ndarray | None:
    """Return the motion (time, dof), its samples on the path within our own tolerance; None if it is lost."""
    retraction = retract_nearest(task.arm, task.tasks, q, task.targets)
    return np.asarray(retraction.q) if retraction.on_path.all() else None


def objectives(task: MotionTask, q: np.ndarray) -> np.ndarray:
    """Return the objectives (n_obj,) of a motion, minimised."""
    motion = task.motion(q)
    return np.array([float(one(motion)) * one.sign for one in task.objectives])


def violation(task: MotionTask, q: np.ndarray) -> float:
    """Return the worst violation of a motion's limits, as a share of their ranges."""
    return float(task.violations(task.motion(q)).max(initial=0.0))


def _worst(tries: Sequence[Attempt]) -> list[str]:
    """Return the place of the largest gain in words, if there is one."""
    best = max(tries, key=lambda one: one.gain)
    if not best.gain > 0:
        return []
    return [
        f"{len({one.point for one in tries if one.gain > DOMINATED})} points beaten",
        f"most: point {best.point}, {best.how}, {best.distance:.1e} rad away",
    ]


SHARES = (1e-4, 1e-5, 1e-6)  # share of the moved ceiling's range: the first whose solves stay near is used
STAY = 0.05  # rad, m: a solve that ends farther off has gone to another valley
WEIGHTY = 1e-3  # least weight with which both objectives count
AGREED = 1e-3
UNIQUE = 1e-6  # relative width below which an interval is a rate
TABLE_ROW = "exchange rates, differences"


class RateComparison(NamedTuple):
    """A rate ∂f_j/∂f_i, NaN if it is not unique, its interval, and quotients of neighbouring solves.

    The quotients use the solves below (backward), above (forward) and both (central).
    """

    point: int
    i: int
    j: int
    rate: float
    interval: np.ndarray
    backward: float
    forward: float
    central: float

    @property
    def unique(self) -> bool:
        """Whether multipliers are."""
        low, high = self.interval
        return bool(high - low <= UNIQUE * abs(high))

    @property
    def off(self) -> float:
        """Relative difference; for an interval, how far the quotients are outside it."""
        if self.unique:
            return abs(self.central / self.rate - 1.0)
        low, high = self.interval
        quotients = np.array([self.backward, self.forward])
        size = abs(self.rate) if np.isfinite(self.rate) else max(abs(low), abs(high))
        return float(np.maximum(quotients - high, low - quotients).max(initial=0.0) / size)


def exchange_rows(subject: Subject) -> list[Row]:
    """Return the difference of rates from quotients, median and worst, and the same for intervals."""
    tried = list(pairs(subject))
    comparisons = [one for one in (compare_rate(subject, *pair) for pair in tried) if one is not None]
    rows = []
    for kind, several in (
        ("rates", [one for one in comparisons if one.unique]),
        ("kinks", [one for one in comparisons if not one.unique]),
    ):
        if not several:
            continue
        off = np.array([one.off for one in several])
        worst, names = several[int(off.argmax())], subject.front.names
        note = (
            f"{len(several)} of {len(tried)} pairs; worst {off.max():.1e}: ∂{names[worst.j]}/∂{names[worst.i]} at "
            f"point {worst.point}, {worst.rate:.6g} against {worst.backward:.6g} and {worst.forward:.6g}"
        )
        column = "median relative difference" if kind == "rates" else "worst way outside the interval"
        value = float(np.median(off) if kind == "rates" else off.max())
        rows.append(goal_row(subject.name, TABLE_ROW, column, "", value, AGREED, note))
    missing = len(tried) - len(comparisons)
    if missing or not tried:
        note = "no ε-solves that stay near" if tried else "no point where two objectives count"
        rows.append(Row(subject.name, TABLE_ROW, "not compared", "pairs", missing, note=note))
    return rows


def pairs(subject: Subject) -> Iterator[tuple[int, int, int]]:
    """Return (point, i, j) if both objectives count, i no more than j: its ceiling moves far for little of j."""
    for point, (weights, status) in enumerate(
        zip(subject.certificates.weights, subject.certificates.status, strict=True)
    ):
        for i, j in permutations(range(len(weights)), 2):
            if status == "minimum" and WEIGHTY < weights[i] <= weights[j]:
                yield point, i, j


def compare_rate(subject: Subject, point: int, i: int, j: int) -> RateComparison | None:
    """Return ∂f_j/∂f_i and the quotient of f_j by the ceiling on f_i; None if no step's solves stay near.

    Further objectives stay below the point's own values. An objective of little weight would be held from one side
    only: it is added to f_j instead, with its own weight, which does not change the rate.
    """
    weights, count, total = subject.certificates.weights[point], len(subject.ranges), len(subject.program.totals)
    added = (weights <= WEIGHTY) | (np.arange(count) == j)
    factors, caps = np.zeros((1, total)), np.full((3, total), np.inf)
    factors[0, :count] = np.where(added, weights / weights[j], 0.0)
    caps[:, :count] = np.where(added, np.inf, subject.values[point] / subject.ranges)
    q = subject.q[point]
    for step in SHARES:  # solves below, at and above the ceiling on f_i in the point's own valley
        upper = caps.copy()
        upper[:, i] += step * np.array([-1.0, 0.0, 1.0])
        got = minimise(subject.program, np.repeat(q[None], 3, axis=0), factors, upper, EPSILON.near)
        if got.converged.all() and joint_distance(subject.task, q, got.x).max() <= STAY:
            break
    else:
        return None
    signs = np.array([one.sign for one in subject.task.objectives])
    natural = (subject.ranges * signs)[[i, j]]
    low, middle, high = np.stack([got.objectives[:, i], got.objectives @ factors[0]], axis=1) * natural

    def quotient(one: np.ndarray, other: np.ndarray) -> float:
        return float((other[1] - one[1]) / (other[0] - one[0]))

    rates, intervals = subject.certificates.exchange_rates, subject.certificates.exchange_intervals
    quotients = quotient(low, middle), quotient(middle, high), quotient(low, high)
    return RateComparison(point, i, j, float(rates[point, i, j]), intervals[point, i, j], *quotients)

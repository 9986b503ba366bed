"""A primal–dual interior-point method for small smooth programs, from afar.

Limits get slacks, kept positive by a barrier that falls; steps are Newton's on the perturbed conditions, with exact
second derivatives, made positive definite where they are not. A filter judges them: a step is taken that is better in
violations or in cost than all before. Where none is, least squares lead back to the limits. From afar it takes a
fraction of the time of quadratic programs one after another (``sequential``). Source: Wächter & Biegler 2006;
Nocedal & Wright, Numerical Optimization, chapter 19.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.optimize import least_squares

from paretoik.errors import EvaluationFailed
from paretoik.nlp.dense_sqp import Caps, Local, Minimum, local, rows_of, slopes_of
from paretoik.nlp.traced import Rows

BARRIER, LAST = 1e-2, 1e-12  # first and last
SHARE, POWER = 0.2, 1.5  # the next barrier is the less of a share and a power of the last
SOLVED = 10.0  # times the barrier: what the conditions may be off before it falls
FLAT, FEASIBLE = 1e-8, 1e-10  # what slopes and violations may be off at any barrier
MANY = 100.0  # a multiplier, of which on they count by their size
ROOM = 1e-2  # what a slack begins with at least
BOUNDARY = 0.99  # of the way to where a slack or multiplier would be gone
GAINED = 1e-5  # of the violation: what a step has to gain in violations or in cost
ARMIJO, ROUNDING = 1e-4, 1e-13  # of what is promised; of the cost
STEEP, OFTEN = 2.3, 1.1  # powers of promise and violation: where cost alone decides
SMALL = 1e-4  # of the first violation, up to where it may
SHORTEST = 1e-10  # share of a step
LIFTED, HIGHEST = 1e-6, 1e8  # first and last multiple of the identity that makes second derivatives positive
CENTRED = 1e10  # times: how far a multiplier may be from barrier over slack
FAR = 1e6  # violation of a row that is not finite
RETURNS, LOOKED, NEARER = 12, 60, 0.9  # ways back at most, evaluations of each, and what one has to leave of violations


@dataclass(frozen=True, kw_only=True, eq=False)
class _Iterate:
    """A place to first order, and slacks and multipliers of its inequalities, caps among them, and equalities."""

    at: Local
    slack: np.ndarray
    push: np.ndarray
    pull: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class _Step:
    """Newton's step of unknowns, slacks and multipliers."""

    z: np.ndarray
    slack: np.ndarray
    push: np.ndarray
    pull: np.ndarray


@dataclass(kw_only=True)
class _Filter:
    """Violations and costs that a step has to better, one or the other; ``small`` violations leave cost to decide."""

    small: float
    pairs: list[tuple[float, float]] = field(default_factory=list)

    def takes(self, before: tuple[float, float], after: tuple[float, float], slope: float, share: float) -> bool:
        """Return whether a share of a step is taken that promises a slope of the cost, and remember what it left."""
        (off, value), (left, worth) = before, after
        rounding = ROUNDING * max(1.0, abs(value))
        if any(left >= (1 - GAINED) * known and worth >= cost - GAINED * known for known, cost in self.pairs):
            return False
        if off <= self.small and slope < 0 and share * (-slope) ** STEEP > off**OFTEN:
            return worth <= value + ARMIJO * share * slope + rounding
        if left > (1 - GAINED) * off and worth > value - GAINED * off + rounding:
            return False
        self.pairs.append((off, value))
        return True


def approached(
    program: Rows,
    cost: Float[np.ndarray, " unknowns"],
    z: Float[np.ndarray, " unknowns"],
    *,
    caps: Caps | None = None,
    iterations: int = 300,
) -> Minimum:
    """Return a local minimum of cost · z below caps, complementary to ``LAST``, from any place.

    Raises EvaluationFailed where the program is not finite.
    """
    size = float(np.linalg.norm(cost)) or 1.0
    cost, barrier, done, returns = cost / size, BARRIER, 0, 0
    it = _fresh(local(program, z, caps), cost, barrier)
    judge = _Filter(small=SMALL * max(1.0, _worth(cost, it.at.z, it.slack, it.at.equal, it.at.room, barrier)[0]))
    while True:
        while (solved := _solved(it, cost, barrier)) and barrier > LAST:
            barrier = max(LAST, min(SHARE * barrier, barrier**POWER))
            judge.pairs.clear()
        if solved or done == iterations:
            break
        done += 1
        step = _newton(program, it, cost, caps, barrier)
        found = None if step is None else _searched(program, it, step, cost, caps, barrier, judge)
        if found is None and step is not None and judge.pairs and returns < RETURNS:
            judge.pairs.clear()  # it may have been too strict
            returns += 1
            found = _searched(program, it, step, cost, caps, barrier, judge)
        if found is None:
            back = _back(program, it, caps, barrier) if returns < RETURNS else None
            if back is None:
                break
            returns, found = returns + 1, _fresh(back, cost, barrier)
            judge.pairs.clear()
        it = found
    return Minimum(z=it.at.z, limits=size * it.push, violation=it.at.violation, converged=solved, iterations=done)


def _fresh(at: Local, cost: np.ndarray, barrier: float) -> _Iterate:
    """Return a place with slacks and multipliers that belong to the barrier."""
    slack = np.maximum(at.room, min(ROOM, np.sqrt(barrier)))
    push = barrier / slack
    return _Iterate(at=at, slack=slack, push=push, pull=at.back.T @ (cost - at.slopes.T @ push))


def _solved(it: _Iterate, cost: np.ndarray, barrier: float) -> bool:
    """Return whether the perturbed conditions are met; where multipliers are large, they count less."""
    at, most = it.at, SOLVED * barrier
    size = max(1.0, float(it.push.sum()) / (MANY * max(1, len(it.push))))
    dual = np.abs(at.basis.T @ (cost - at.slopes.T @ it.push)).max(initial=0.0) / size
    off = max(np.abs(at.equal).max(initial=0.0), np.abs(at.room - it.slack).max(initial=0.0))
    centred = np.abs(it.slack * it.push - barrier).max(initial=0.0) / size
    return bool(dual <= max(most, FLAT) and off <= max(most, FEASIBLE) and centred <= most)


def _newton(program: Rows, it: _Iterate, cost: np.ndarray, caps: Caps | None, barrier: float) -> _Step | None:
    """Return Newton's step on the perturbed conditions, None where there is none."""
    at, own = it.at, len(it.push) - (0 if caps is None else len(caps.most))
    weights, short, back = it.push / it.slack, at.room - it.slack, -at.back @ at.equal
    bent = program.curvature(at.z, np.concatenate([-it.pull, -it.push[:own]]))
    slopes = at.slopes @ at.basis
    free = at.basis.T @ bent @ at.basis
    table = free + (slopes * weights[:, None]).T @ slopes
    wanted = barrier / it.slack - weights * (short + at.slopes @ back)
    right = slopes.T @ wanted - at.basis.T @ (cost + bent @ back)
    size, lifted = max(1e-3, float(np.abs(np.diagonal(free)).max(initial=0.0))), 0.0
    while lifted <= HIGHEST * size:
        try:
            factor = cho_factor(table + lifted * np.eye(len(table)))
        except LinAlgError:
            lifted = max(LIFTED * size, 4.0 * lifted)
            continue
        z = back + at.basis @ cho_solve(factor, right)
        slack = at.slopes @ z + short
        push = barrier / it.slack - it.push - weights * slack
        pull = at.back.T @ (cost + bent @ z - at.slopes.T @ (it.push + push)) - it.pull
        return _Step(z=z, slack=slack, push=push, pull=pull) if np.isfinite(z).all() else None
    return None


def _searched(
    program: Rows, it: _Iterate, step: _Step, cost: np.ndarray, caps: Caps | None, barrier: float, judge: _Filter
) -> _Iterate | None:
    """Return what the longest share of a step leads to that the filter takes; None for none."""
    before = _worth(cost, it.at.z, it.slack, it.at.equal, it.at.room, barrier)
    slope = float(cost @ step.z) - barrier * float((step.slack / it.slack).sum())
    share = _longest(it.slack, step.slack, barrier)
    while share > SHORTEST:
        z, slack = it.at.z + share * step.z, it.slack + share * step.slack
        equal, room = rows_of(program, z, caps)
        if np.isfinite(equal).all() and np.isfinite(room).all():
            slack = np.maximum(slack, room)  # that costs nothing
            if judge.takes(before, _worth(cost, z, slack, equal, room, barrier), slope, share):
                break
        share /= 2
    else:
        return None
    push = it.push + _longest(it.push, step.push, barrier) * step.push
    push = np.clip(push, barrier / (CENTRED * slack), CENTRED * barrier / slack)
    return _Iterate(at=local(program, z, caps), slack=slack, push=push, pull=it.pull + share * step.pull)


def _worth(
    cost: np.ndarray, z: np.ndarray, slack: np.ndarray, equal: np.ndarray, room: np.ndarray, barrier: float
) -> tuple[float, float]:
    """Return the sum of violations, and the cost with its barrier."""
    off = float(np.abs(equal).sum() + np.abs(room - slack).sum())
    return max(0.0, off - FEASIBLE), float(cost @ z - barrier * np.log(slack).sum())


def _longest(values: np.ndarray, changes: np.ndarray, barrier: float) -> float:
    """Return the share of a step, at most 1, that leaves all values positive."""
    falling = changes < 0
    kept = max(BOUNDARY, 1.0 - barrier)
    return float((-kept * values[falling] / changes[falling]).min(initial=1.0))


def _back(program: Rows, it: _Iterate, caps: Caps | None, barrier: float) -> Local | None:
    """Return a place near by whose limits are violated less, None where least squares find none."""
    least = min(ROOM, np.sqrt(barrier))

    def lacking(z: np.ndarray) -> np.ndarray:
        equal, room = rows_of(program, z, caps)
        return np.nan_to_num(np.concatenate([equal, np.minimum(room - least, 0.0)]), nan=FAR, posinf=FAR, neginf=-FAR)

    def slopes(z: np.ndarray) -> np.ndarray:
        equal, room = rows_of(program, z, caps)
        table = slopes_of(program, z, caps)
        table[len(equal) :][room >= least] = 0.0
        return table

    try:
        end = least_squares(lacking, it.at.z, slopes, max_nfev=LOOKED)
        found = local(program, end.x, caps)
    except (ValueError, LinAlgError, EvaluationFailed):  # a row or a slope was not finite
        return None
    return found if np.linalg.norm(end.fun) < NEARER * np.linalg.norm(lacking(it.at.z)) else None

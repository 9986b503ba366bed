"""Sequential quadratic programming for any Program, also with kinks.

The program, its goal divided by its size, and the merit function:

    minimise    weights · F(x)
    subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper
    merit       weights · F + penalty · (largest violation)

Each iteration solves the convex subproblem of ``nlp.convex_subproblem`` at the iterate. It has linearised elastic
inequalities, a trust region, and the exact Hessian of the Lagrangian with negative eigenvalues raised to nearly 0. If a
step gains less than predicted, a second-order correction is tried. Source: Nocedal & Wright, Numerical Optimization,
section 18.5; Fletcher 1982 for kinks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Point
from paretoik.errors import SolverFailed
from paretoik.nlp.convex_subproblem import Step, convexify, solve_subproblem
from paretoik.nlp.criticality import quick_criticality
from paretoik.nlp.program import (
    CONVERGED,
    INTERRUPTED,
    ITERATION_LIMIT,
    NO_PROGRESS,
    NOT_FINITE,
    VIOLATED,
    Constraints,
    Goal,
    Program,
    bounded,
)
from paretoik.stop_flag import STOP


@dataclass(frozen=True, kw_only=True)
class SqpOptions:
    """Settings of a search.

    The length of a step is its largest entry along the equalities [rad, arm lengths]. The size of the objective is Σ
    |weights · F| at the start, or the length of its gradient if that is more.
    """

    iterations: int = 150
    radius: float = 0.3  # radius of the first trust region
    largest_radius: float = 0.4  # largest radius: too short to skip to another branch
    smallest_radius: float = 1e-10  # shortest step that is tried
    tolerance: float = 1e-8  # largest violation, as a share of a range
    penalty: float = 10.0  # first penalty of a violation of a whole range, in sizes of the objective
    largest_penalty: float = 1e7  # largest penalty; the search ends if it does not satisfy the limits
    penalty_factor: float = 10.0
    recovery: float = 1e-2  # violation above which a step that lowers it by less than a tenth raises the penalty
    acceptance: float = 1e-4  # least gain of an accepted step, over the predicted one
    agreement: float = 0.75  # least gain, over the predicted one, that needs no correction and enlarges the region
    excess: float = 1.3  # gain, over the predicted one, above which the Hessian is too stiff
    corrections: int = 1  # number of second-order corrections of one step
    flattening: float = 1e-8  # least eigenvalue of a flattened Hessian, as a share of its largest entry
    step_tolerance: float = 1e-8  # tolerance of a step's optimality gap and infeasibility
    last_tolerance: float = 1e-12  # the same for the last steps
    smallest_share: float = 1e-6  # least factor of a Hessian that is too stiff
    reduction_tolerance: float = 1e-15  # largest predicted gain that counts as rounding, as a share of the merit
    criticality_tolerance: float = 5e-7  # largest first-order gain of an optimum, in sizes of the objective


OPTIONS = SqpOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """The last point of a search.

    status: a key of STATUSES
    objectives: F at the point
    multipliers: multipliers of the inequalities
    bound_multipliers: multipliers of the goal's finite bounds
    stationarity: RMS length of the Lagrangian's gradient
    violation: worst violation of all constraints, as a share of its range
    """

    x: Point
    status: int
    iterations: int
    objectives: Float[np.ndarray, " objectives"]
    multipliers: Float[np.ndarray, " inequalities"]
    bound_multipliers: Float[np.ndarray, " bounds"]
    stationarity: float
    violation: float


@dataclass(frozen=True, kw_only=True, eq=False)
class _Iterate:
    """A point, F there, and the parts of the merit function.

    value: objective value, weights · F
    infeasibility: largest violation of all constraints except the goal's bounds
    excess: largest violation of the goal's bounds, in sizes of the objective
    """

    x: Point
    objectives: Float[np.ndarray, " objectives"]
    value: float
    infeasibility: float
    excess: float

    @property
    def violation(self) -> float:
        """The largest violation; NaN if any is NaN."""
        return float(np.maximum(self.infeasibility, self.excess))

    def merit(self, penalty: float) -> float:
        """Return the value of the merit function."""
        return self.value + penalty * self.violation


@dataclass(frozen=True, kw_only=True, eq=False)
class _Attempt:
    """A tried step.

    trial: point after the step; None if it was not reached
    predicted: predicted gain in merit
    gain: actual gain in merit
    length: length of the step before any correction
    settled: whether nothing was tried, because the predicted gain was only rounding
    """

    step: Step
    trial: _Iterate | None
    predicted: float
    gain: float
    length: float
    settled: bool = False


def minimise(program: Program, x: Point, goal: Goal, options: SqpOptions = OPTIONS) -> Solution:
    """Return the local minimum of a goal that a point on or near the equalities leads to.

        minimise    weights · F(x)
        subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper

    After a signal this is the current point. The search ends at once if values or derivatives are not finite; some
    programs then raise EvaluationFailed.
    """
    with np.errstate(invalid="ignore"):  # the search checks for values that are not finite
        search = _Search(program, x, goal, options)
        while search.status is None:
            search.advance()
        return search.solution()


class _Search:
    """The state of a search: iterate, trust region, penalty, and multipliers of the last step.

    The goal and its bounds are divided by the goal's size, so the cost of a violation does not depend on units of F.
    """

    def __init__(self, program: Program, x: Point, goal: Goal, options: SqpOptions) -> None:
        finite = np.isfinite(goal.upper)
        self.program, self.options = program, options
        self.at = program.linearise(x)
        value = float(np.abs(goal.weights * self.at.objectives).sum())
        self.size = max(value, float(np.linalg.norm(goal.weights @ self.at.gradients))) or 1.0
        self.goal = Goal(
            weights=goal.weights / self.size, rows=goal.rows[finite] / self.size, upper=goal.upper[finite] / self.size
        )
        self.iterate = self._evaluate(x)
        self.last: Step | None = None
        self.penalty, self.radius, self.share = options.penalty, options.radius, 1.0
        self.tolerance = options.step_tolerance
        self.iterations, self.stationarity = 0, np.inf
        self.status: int | None = None

    def advance(self) -> None:
        """Take one step, or end the search."""
        options = self.options
        if STOP[0]:
            self.status = INTERRUPTED
            return
        if self.iterations >= options.iterations:
            self.status = CONVERGED if self._is_critical() else ITERATION_LIMIT
            return
        if not np.isfinite([self.iterate.merit(self.penalty), *self.at.gradients.flat]).all():
            self.status = NOT_FINITE
            return
        self.iterations += 1
        # the subproblem at the iterate: gradient g, and Hessian H of the Lagrangian, made convex
        self.constraints, self.elastic = bounded(self.at, self.goal)
        multipliers, bound_multipliers = self._split_multipliers()
        weights = self.goal.weights + self.goal.rows.T @ bound_multipliers
        hessian = self.at.hessian(weights, multipliers, () if self.last is None else self.last.cone_multipliers)
        self.gradient = self.goal.weights @ self.at.gradients
        self.hessian = self.share * convexify(hessian, self.constraints.unknowns, options.flattening)
        # its step d; the trust region shrinks until merit(x) − merit(x + d) ≥ acceptance · predicted gain
        attempt: _Attempt | None = None
        while self.radius > options.smallest_radius and attempt is None:
            step = self._solve(self.constraints)
            if step is None:
                self.radius /= 4
                continue
            attempt = self._attempt(step)
            if not attempt.settled and not attempt.gain >= options.acceptance * attempt.predicted:
                self.radius, attempt = min(self.radius, attempt.length) / 4, None
        if attempt is None or attempt.trial is None:
            self._end(settled=attempt is not None and attempt.settled)
            return
        before, self.iterate, self.last = self.iterate.violation, attempt.trial, attempt.step
        # the penalty grows if a large violation has not fallen by a tenth
        if self.iterate.violation > max(options.recovery, 0.9 * before) and self.penalty < options.largest_penalty:
            self.penalty *= options.penalty_factor
        self.at = self.program.linearise(self.iterate.x)
        # the factor of the Hessian and the trust region, by the ratio gain / predicted gain
        if attempt.gain > options.excess * attempt.predicted:
            self.share = max(self.share / 4, options.smallest_share)
        elif attempt.gain < options.agreement * attempt.predicted:
            self.share = min(4 * self.share, 1.0)
        if attempt.gain >= options.agreement * attempt.predicted and attempt.length > 0.9 * self.radius:
            self.radius = min(2 * self.radius, options.largest_radius)

    def solution(self) -> Solution:
        """Return the result of the search."""
        assert self.status is not None
        multipliers, bound_multipliers = self._split_multipliers()
        return Solution(
            x=self.iterate.x,
            status=self.status,
            iterations=self.iterations,
            objectives=self.iterate.objectives,
            multipliers=self.size * multipliers,
            bound_multipliers=bound_multipliers,
            stationarity=self.size * self.stationarity,
            violation=self._worst_violation(),
        )

    def _worst_violation(self) -> float:
        """Return the worst of all violations, those of bounds in units of F."""
        return float(np.maximum(self.iterate.infeasibility, self.size * self.iterate.excess))  # NaN if any is

    def _evaluate(self, x: Point) -> _Iterate:
        objectives, equalities, inequalities = self.program.evaluate(x)
        bounds = self.goal.upper - self.goal.rows @ objectives
        violations = np.concatenate([[0.0], np.abs(equalities), -inequalities])
        return _Iterate(
            x=x,
            objectives=objectives,
            value=float(self.goal.weights @ objectives),
            infeasibility=float(violations.max()),  # NaN if any is
            excess=float(np.append(0.0, -bounds).max()),
        )

    def _split_multipliers(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the multipliers of the program's inequalities and those of the goal's bounds."""
        elastic, bounds = self.at.elastic, len(self.goal.upper)
        if self.last is None:
            return np.zeros(len(self.at.inequalities)), np.zeros(bounds)
        parts = np.split(self.last.multipliers, [elastic, elastic + bounds])
        return np.concatenate([parts[0], parts[2]]), parts[1]

    def _attempt(self, step: Step) -> _Attempt:
        """Try a step, unless no gain is predicted, and its correction if it gains too little."""
        options, d = self.options, step.step
        before, curvature = self.iterate.merit(self.penalty), self.hessian @ d
        # the predicted gain: penalty · (violation − t) − (gᵀd + ½ dᵀHd)
        linear = float(self.gradient @ d) + 0.5 * float(d @ curvature)
        predicted = self.penalty * (self.iterate.violation - max(step.violation, 0.0)) - linear
        length = float(np.abs(d[: self.at.unknowns]).max(initial=0.0))
        self.stationarity = float(np.linalg.norm(curvature[: self.at.unknowns])) * self.at.unit
        rounding = options.reduction_tolerance * (1 + abs(before))
        attempt = _Attempt(step=step, trial=None, predicted=predicted, gain=-np.inf, length=length)
        if predicted <= rounding and length < 0.99 * self.radius:
            return replace(attempt, settled=True)
        for correction in range(options.corrections + 1):
            x = self.at.retract(step.step)
            trial = None if x is None else self._evaluate(x)
            if x is None or trial is None or not np.isfinite(trial.merit(self.penalty)):
                break
            gain = before - trial.merit(self.penalty)
            if not correction or gain > max(attempt.gain, 0.0):
                attempt = replace(attempt, step=step, trial=trial, gain=gain)
            enough = attempt.gain >= options.agreement * predicted or correction == options.corrections
            if enough:
                break
            # second-order correction: c(x + d) − J d in place of c (Eq. 18.23)
            inequalities, elastic = self.at.corrected_inequalities(step.step, x), self.at.elastic
            bounds = self.goal.upper - self.goal.rows @ trial.objectives
            values = np.concatenate([inequalities[:elastic], bounds, inequalities[elastic:]])
            values -= self.constraints.jacobian @ step.step
            corrected = self._solve(replace(self.constraints, values=values))
            if corrected is None:
                break
            step = corrected
        return attempt

    def _solve(self, constraints: Constraints) -> Step | None:
        try:
            return solve_subproblem(
                self.gradient,
                self.hessian,
                constraints,
                elastic=self.elastic,
                radius=self.radius,
                penalty=self.penalty,
                tolerance=self.tolerance,
            )
        except SolverFailed:
            return None

    def _end(self, *, settled: bool) -> None:
        """End the search, or raise the penalty of violations; ``settled``: whether no gain is predicted."""
        options = self.options
        if settled and self.tolerance > options.last_tolerance:
            self.tolerance = options.last_tolerance
            return
        feasible = self._worst_violation() <= options.tolerance
        if not feasible and self.penalty < options.largest_penalty:
            self.penalty *= options.penalty_factor
            self.radius = max(options.radius, self.radius)
            return
        if not feasible:
            self.status = VIOLATED
        else:
            self.status = CONVERGED if settled or self._is_critical() else NO_PROGRESS

    def _is_critical(self) -> bool:
        """Return whether the iterate is feasible, and no direction gains more than rounding to first order."""
        constraints, _ = bounded(self.at, self.goal)
        gain = quick_criticality((self.goal.weights @ self.at.gradients)[None], constraints, self.at.unit).value
        return bool(self._worst_violation() <= self.options.tolerance and gain <= self.options.criticality_tolerance)

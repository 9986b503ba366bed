"""Refine a front's points by gradients to local optima; no objective gets worse."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.arrays import Genes, Point, Points
from paretoik.errors import EvaluationFailed, SolverFailed, warn_user
from paretoik.front.hypervolume import ranges_of
from paretoik.nlp.minimise import compile_method, minimise
from paretoik.nlp.program import (
    FEASIBLE,
    Goal,
    InteriorPointOptions,
    Linearisation,
    Program,
    Solutions,
    Solver,
    program_key,
    violation_at,
)
from paretoik.pareto.certificates import OPTIONS as CERTIFICATES
from paretoik.pareto.certificates import criticality_at, criticality_bound, weights_at
from paretoik.pareto.continuation import can_follow, correct, guess_optimum
from paretoik.pareto.differentiable import Differentiable
from paretoik.pareto.scalarisation import Observe, evaluate_points, main_weights, minimise_weighted
from paretoik.runs.distribution import Lost, distribute_remembered, workers
from paretoik.runs.journal import Values, recalled, remembered
from paretoik.stop_flag import Interrupted, check_interruption

# Gradients in an evolutionary search: a few iterations from points of its front, every few generations.


@dataclass(frozen=True, kw_only=True)
class ImproverOptions:
    """Settings of gradients in an evolutionary search."""

    every: int = 10  # number of generations between two uses of gradients
    share: float = 0.3  # largest number of iterations, as a share of all evaluations
    gaps: int = 4  # number of widest gaps in which points are searched each time
    weight: float = 1e-6  # weight of the objectives that are not minimised
    # solver settings with few iterations per point
    brief: InteriorPointOptions = InteriorPointOptions(barrier=1e-2, iterations=5, radius=0.1)


IMPROVER_OPTIONS = ImproverOptions()


def suggest_points(
    program: Program,
    x: Points,
    F: Float[np.ndarray, "points n_obj"],
    branches: Sequence[str],
    *,
    solver: Solver = "auto",
) -> tuple[Float[np.ndarray, " suggested *point"], int]:
    """Return the points after a few iterations from those of a front, and the number of iterations.

        minimise    F̂_m + weight · Σ F̂_j        F̂: objectives divided by their ranges
        subject to  F_j ≤ ε_j for j ≠ m

    At the ends of the front ε is infinite; in its widest gaps ε is the midpoint of the gap; for the best point of every
    branch ε is its own objectives. The front must have at least two points.
    """
    count, ranges = F.shape[1], ranges_of(F)
    shares = F / ranges
    aims = [(int(np.argmin(F[:, k])), k, np.full(count, np.inf)) for k in range(count)]  # row, objective, ε
    distances = np.linalg.norm(shares[:, None] - shares[None], axis=2)
    np.fill_diagonal(distances, np.inf)
    nearest = distances.argmin(axis=1)
    for turn, i in enumerate(np.argsort(-distances.min(axis=1))[: IMPROVER_OPTIONS.gaps] if count > 1 else ()):
        aims.append((int(i), turn % count, (F[i] + F[nearest[i]]) / 2))
    labels = np.array(branches)
    for label in np.unique(labels):
        members = np.flatnonzero(labels == label)
        best = int(members[np.argmin(shares[members].sum(axis=1))])
        aims.append((best, (len(aims) + 1) % count, F[best]))
    rows, mains, upper = (np.array(column) for column in zip(*aims, strict=True))
    upper[np.arange(len(rows)), mains] = np.inf
    weights = main_weights(count, mains, IMPROVER_OPTIONS.weight) / ranges
    solutions = minimise_weighted(program, x[rows], weights, upper, IMPROVER_OPTIONS.brief, solver=solver)
    return solutions.x[np.isfinite(solutions.objectives).all(axis=1)], int(solutions.iterations.sum())


class SearchImprover:
    """Genes for a search, found by gradients from its front.

    ``spent`` is the number of iterations; each counts as one evaluation. Raises InvalidInput if an objective or limit
    has no derivative.
    """

    def __init__(self, search: Any, formulation: Differentiable, solver: Solver = "auto") -> None:
        self.spent = 0
        self._search, self._formulation, self._solver = search, formulation, solver
        self._program = formulation.program()

    def __call__(self, progress: Any) -> Genes | None:
        """Return genes to evaluate next, or None if gradients are not due."""
        front, options = self._search.archive.members, IMPROVER_OPTIONS
        due = progress.generation % options.every == 0 and self.spent <= options.share * progress.evaluations
        if not due or front is None or len(front) < 2:
            return None
        x = self._formulation.points(front.X)
        x, iterations = suggest_points(self._program, x, front.F, self._formulation.branches(x), solver=self._solver)
        self.spent += iterations
        return self._formulation.genes(x)


# Refinement of points: no objective gets worse.


@dataclass(frozen=True, kw_only=True)
class RefineOptions:
    """Settings of refinement; objectives are divided by their ranges.

    - Attempts are ``straight``, ``below``, ``near``, ``cold``, in this order. The next one follows if one does not
      converge or an objective rises.
    - A critical point may be only weakly optimal if an objective has no weight: this objective may still gain. These
      points are refined by ``below`` too.
    """

    weight: float = 0.1  # weight of the sum of all objectives, added to the first; it finds gains at almost no loss
    critical: float = 1e-8  # largest criticality of a point that is not refined
    stationary: float = 1e-6  # largest stationarity of an optimum
    rise: float = 1e-9  # largest rise of an objective that counts as 0
    gain: float = 1e-6  # smallest gain for which a refined weak optimum is kept
    batch: int = 4  # number of points refined between two calls of the observer, which may end the refinement
    # solver settings of the first attempt: all objectives gain at least as much as the first
    straight: InteriorPointOptions = InteriorPointOptions(barrier=1e-4, radius=0.02, iterations=75)
    # solver settings of the second attempt: equal weights, no objective may rise (Benson 1978); it needs a tenth of the
    # iterations if the way of the first attempt is curved
    below: InteriorPointOptions = InteriorPointOptions(barrier=1e-4, radius=0.02)
    # near, cold: solver settings of further attempts like ``straight``
    near: InteriorPointOptions = InteriorPointOptions(barrier=1e-6, radius=0.02)
    cold: InteriorPointOptions = InteriorPointOptions(barrier=0.1, radius=0.2)


OPTIONS = RefineOptions()


def refine(
    program: Program, x: Points, n_obj: int, *, solver: Solver = "auto", observe: Observe | None = None
) -> tuple[Points, Bool[np.ndarray, " points"]]:
    """Return points, none worse than before, and whether each is optimal now.

        minimise    F₀(y) + weight · Σ F_j(y)
        subject to  F_j(y) − F₀(y) ≤ F_j(x) − F₀(x) for j > 0,  F₀(y) ≤ F₀(x)

    Every objective gains at least as much as the first, so each point moves straight ahead and keeps its place among
    its neighbours (Pascoletti & Serafini 1984). The program's first objectives are those of the front, divided by their
    ranges. Points stay if they are critical or no better one is found. ``observe`` is called with the number of refined
    points, the number of all, and the last refined point; if it returns true, or after a signal, the other points stay.
    """
    refined, converged, finished = x.copy(), np.zeros(len(x), dtype=bool), np.zeros(len(x), dtype=bool)
    done, count = 0, len(x)
    keys = [program_key("refined point", program, one, n_obj, solver) for one in x]
    refine_points = _refine_in_workers if count > 1 and workers() > 1 else _refine_here
    with suppress(Interrupted):
        for i, values in refine_points(program, x, n_obj, solver, keys):
            refined[i], converged[i], finished[i] = values["x"], values["converged"], True
            while done < count and finished[done : done + OPTIONS.batch].all():
                done = min(done + OPTIONS.batch, count)
                if observe is not None and observe(done, count, refined[done - 1]):
                    # the result must not depend on which points the workers computed earlier
                    refined[done:], converged[done:] = x[done:], False
                    return refined, converged
    return refined, converged


def _refine_here(
    program: Program, x: Points, n_obj: int, solver: Solver, keys: Sequence[bytes | None]
) -> Iterator[tuple[int, Values]]:
    """Yield every point's index and refined values, remembered in the run's journal.

    Raises Interrupted after a signal, after yielding the better points found so far.
    """
    attempts = _attempts(n_obj, len(program.upper))
    for first in range(0, len(x), OPTIONS.batch):
        places, interruption = range(first, min(first + OPTIONS.batch, len(x))), list[Interrupted]()
        stored = {i: values for i in places if (key := keys[i]) is not None and (values := recalled(key))}
        rows = np.array([i for i in places if i not in stored], dtype=int)
        points, converged = x[rows], np.zeros(len(rows), dtype=bool)
        try:
            _refine_rows(program, points, converged, attempts, n_obj, solver)
            # replace weak optima (an objective has no weight) in place by points that gain without loss
            below = attempts[1]
            weak = np.flatnonzero(weights_at(program, points, n_obj).min(axis=1, initial=1.0) < CERTIFICATES.weight)
            if len(weak):
                before = evaluate_points(program, points[weak])
                upper = before.objectives @ below.rows.T
                solutions = minimise(
                    program, points[weak], below.weights, upper, below.options, rows=below.rows, solver=solver
                )
                gain = (before.objectives - solutions.objectives)[:, :n_obj].max(axis=1)
                better = _no_worse(program, points[weak], solutions, n_obj) & (solutions.violation <= FEASIBLE)
                accepted = better & (gain > OPTIONS.gain)
                points[weak[accepted]] = solutions.x[accepted]
        except Interrupted as signal:
            interruption.append(signal)
        yield from stored.items()
        for i, point, is_optimum in zip(rows.tolist(), points, converged, strict=True):
            yield i, remembered(keys[i], partial(_values_of, point, is_optimum))
        if interruption:
            raise interruption[0]


def _refine_in_workers(
    program: Program, x: Points, n_obj: int, solver: Solver, keys: Sequence[bytes | None]
) -> Iterator[tuple[int, Values]]:
    """Yield every point's index and values, refined by workers; a lost point stays as it is."""
    check_interruption()
    attempt = _attempts(n_obj, len(program.upper))[0]
    compile_method(program, x[0], attempt.weights, attempt.options, solver=solver)
    items = [(one, n_obj, solver) for one in x]
    for i, values in distribute_remembered(_refine_point, program, items, keys):
        if isinstance(values, Lost):
            warn_user(f"point {i}: {values.cause}; it stays as it is")
            yield i, _values_of(x[i], False)
        else:
            yield i, values


def _refine_point(program: Program, item: tuple[Point, int, Solver]) -> Values:
    """Return the refined values of a point, in a worker."""
    point, n_obj, solver = item
    ((_, values),) = _refine_here(program, point[None], n_obj, solver, [None])
    return values


def _values_of(point: Point, converged: Any) -> Values:
    return {"x": point, "converged": np.asarray(converged)}


class _Attempt(NamedTuple):
    """An attempt: minimise weights · F(y) subject to rows · F(y) ≤ rows · F(start)."""

    weights: Float[np.ndarray, "1 objectives"]
    rows: Float[np.ndarray, "n_obj objectives"]
    options: InteriorPointOptions


def _attempts(n_obj: int, objectives: int) -> tuple[_Attempt, ...]:
    equal, straight = np.zeros((1, objectives)), np.zeros((1, objectives))
    equal[0, :n_obj], straight[0, :n_obj] = 1.0, OPTIONS.weight
    straight[0, 0] += 1.0
    below, ahead = np.eye(n_obj, objectives), np.eye(n_obj, objectives)
    ahead[1:, 0] = -1.0  # F_j − F_0
    return (
        _Attempt(straight, ahead, OPTIONS.straight),
        _Attempt(equal, below, OPTIONS.below),
        _Attempt(straight, ahead, OPTIONS.near),
        _Attempt(straight, ahead, OPTIONS.cold),
    )


def _refine_rows(
    program: Program,
    x: Points,
    converged: Bool[np.ndarray, " points"],
    attempts: tuple[_Attempt, ...],
    n_obj: int,
    solver: Solver,
) -> None:
    """Refine points in place; those found before a signal raises Interrupted are kept."""
    for i, one in enumerate(x):
        check_interruption()
        converged[i] = _is_critical(program, one, n_obj, OPTIONS.critical, criticality_bound)
    for attempt in attempts:
        remaining = np.flatnonzero(~converged)
        if not len(remaining):
            return
        upper = np.array([attempt.rows @ program.evaluate(one)[0] for one in x[remaining]])
        try:
            solutions = minimise(
                program, x[remaining], attempt.weights, upper, attempt.options, rows=attempt.rows, solver=solver
            )
        except Interrupted as stop:
            if stop.partial is not None:
                _keep(program, x, converged, remaining, stop.partial, attempt)
            raise
        better = _keep(program, x, converged, remaining, solutions, attempt)
        if solver == "sqp" or not can_follow(program):
            continue
        # accept critical points of Newton's method that are no worse: in a flat valley rounding hides a gain from the
        # solver's merit function, but gradients still show it
        for i in better[~converged[better]]:
            goal = Goal(weights=attempt.weights[0], rows=attempt.rows, upper=attempt.rows @ program.evaluate(x[i])[0])
            guess = guess_optimum(program, x[i], goal)
            corrected = None if guess is None else correct(program, guess, goal)
            if corrected is not None:
                point: Point = corrected[0].x
                no_worse = _no_worse(program, x[[i]], evaluate_points(program, point[None]), n_obj)[0]
                if no_worse and _is_critical(program, point, n_obj, CERTIFICATES.critical, criticality_at):
                    x[i], converged[i] = point, True


def _keep(
    program: Program,
    x: Points,
    converged: Bool[np.ndarray, " points"],
    rows: Int[np.ndarray, " rows"],
    solutions: Solutions,
    attempt: _Attempt,
) -> Int[np.ndarray, " better"]:
    """Replace points by solutions that are no worse; return the replaced rows.

    An attempt's optimum is optimal for the front only if no objective has a negative weight: in a straight attempt the
    others may be able to fall only if the first rises.
    """
    n_obj = len(attempt.rows)
    weights = attempt.weights + solutions.bound_multipliers[:, :n_obj] @ attempt.rows
    critical = (solutions.stationarity <= OPTIONS.stationary) & (weights[:, :n_obj].min(axis=1) >= 0.0)
    better = _no_worse(program, x[rows], solutions, n_obj)
    feasible = solutions.violation <= FEASIBLE
    good = better & (solutions.converged | (feasible & np.isfinite(solutions.objectives).all(axis=1)))
    x[rows[good]] = solutions.x[good]
    for i, solved, optimal in zip(rows[good], solutions.converged[good], critical[good], strict=True):
        # in a flat valley rounding hides a gain from the solver, but all objectives together may still gain
        converged[i] = solved and (optimal or _is_critical(program, x[i], n_obj, CERTIFICATES.critical, criticality_at))
    return rows[good]


def _no_worse(program: Program, x: Points, solutions: Solutions, n_obj: int) -> Bool[np.ndarray, " points"]:
    """Return which solutions are no worse than their starts, or start from an infeasible point."""
    before = evaluate_points(program, x)
    rise = (solutions.objectives - before.objectives)[:, :n_obj].max(axis=1)
    return (rise <= OPTIONS.rise) | (before.violation > FEASIBLE)


def _is_critical(
    program: Program,
    x: np.ndarray,
    n_obj: int,
    tolerance: float,
    value: Callable[[Program, Linearisation, np.ndarray], float],
) -> bool:
    """Return whether a point is feasible and its criticality, by ``value``, is within the tolerance."""
    try:
        at = program.linearise(x)
        if violation_at(program, at) > FEASIBLE:
            return False
        return value(program, at, np.ones(n_obj)) <= tolerance
    except (SolverFailed, EvaluationFailed):
        return False

"""Fronts of any program by ε-constraints; each program is solved from several starts.

    minimise    F_m(x) + weight · Σ_j≠m F_j(x)
    subject to  F_j(x) ≤ ε_j for all j ≠ m

Source: Tringali & Cocuzza 2020, section 4.3, with inequalities in place of the printed equality, which may return
dominated points; Haimes et al. 1971.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Points
from paretoik.front.hypervolume import ranges_of
from paretoik.nlp.program import FEASIBLE, InteriorPointOptions, Program, Solutions, Solver
from paretoik.pareto.certificates import weights_at
from paretoik.pareto.placement import POINT_TOLERANCE
from paretoik.pareto.refine import refine
from paretoik.pareto.scalarisation import (
    ColdSearch,
    evaluate_points,
    main_weights,
    minimise_weighted,
    objective_sizes,
    optima_alone,
)
from paretoik.pareto.sweep import OPTIONS, ObserveSweep, Sweep
from paretoik.stop_flag import Interrupted, check_interruption


def epsilon_points(
    program_of: Callable[[Float[np.ndarray, " n_obj"]], Program],
    cold: ColdSearch,
    n_obj: int,
    *,
    points: int,
    initial: Float[np.ndarray, " initial *point"] | None = None,
    refined: bool = False,
    cold_points: int = OPTIONS.cold_points,
    solver: Solver = "auto",
    observe: ObserveSweep | None = None,
) -> tuple[Points, Float[np.ndarray, " n_obj"]]:
    """Return points spread over the front, and the objectives' ranges.

    There are at most ``points`` points, which always include the ends of the front.

    - Find the ends.
    - Two objectives: place points where the front gains the most hypervolume.
    - More objectives: search from cold starts below some ε, then fill the widest gaps, with ε halfway between two
      neighbours and starts near it.

    program_of: function that returns the program with objectives divided by its argument
    cold_points: number of first points that are also searched from cold starts (only for two objectives)
    initial: known points; the feasible ones are starts too, and none of them dominates the result
    refined: whether initial points are refined already
    observe: function called with the progress

    After a signal the points found so far are returned, ``initial`` ones included. Raises the errors of ``cold``, and
    Interrupted if a signal comes before the first point.
    """
    # the optima of each objective alone
    natural = program_of(np.ones(n_obj))
    if initial is not None:
        initial = initial[evaluate_points(natural, initial).violation <= FEASIBLE]
        initial = initial if len(initial) else None
    alone = list[Points]()
    try:
        for k in range(n_obj):
            alone.append(optima_alone(program_of, cold, k, n_obj, initial, solver))
    except Interrupted:
        if not alone:
            raise
    best = np.stack([optima[0] for optima in alone])
    payoff = np.stack([natural.evaluate(x)[0][:n_obj] for x in best])
    sizes = objective_sizes(natural, best, n_obj)
    near = natural.distance(best[0], best) <= OPTIONS.resolved_distance
    if len(alone) == n_obj and near.all() and (np.ptp(payoff, axis=0) <= OPTIONS.resolution * sizes).all():
        return best[:1], np.where(sizes > 0, sizes, 1.0)  # the front is only one point
    # the ends of the front
    ranges = ranges_of(payoff, sizes)
    program = program_of(ranges)
    ends = evaluate_points(program, best)
    if len(alone) == n_obj:
        with suppress(Interrupted):
            ends, program, ranges = _rescaled_ends(program_of, best, ranges, sizes, solver)
    if initial is not None and not refined:
        initial = refine(program, initial, n_obj, solver=solver)[0]
    sweep = Sweep(
        program=program,
        n_obj=n_obj,
        x=ends.x,
        objectives=ends.objectives,
        weights=np.eye(n_obj)[: len(best)],
        points=points,
        solver=solver,
        observe=observe,
        ranges=ranges,
        rounds=int(cold.multimodal or n_obj > 2),
    )
    further = max(OPTIONS.further, int(OPTIONS.further_share * points), 0 if initial is None else points)
    if initial is not None:
        weights = None  # needed only with two objectives, for the tangents of the front
        with suppress(Interrupted):
            weights = weights_at(program, initial, n_obj) if n_obj == 2 else None
        sweep.add(evaluate_points(program, initial), weights)
    with suppress(Interrupted):
        _add_points(sweep, cold, cold_points, further)
    return sweep.x[sweep.spread()], ranges


def _rescaled_ends(
    program_of: Callable[[Float[np.ndarray, " n_obj"]], Program],
    best: Points,
    ranges: Float[np.ndarray, " n_obj"],
    sizes: Float[np.ndarray, " n_obj"],
    solver: Solver,
) -> tuple[Solutions, Program, Float[np.ndarray, " n_obj"]]:
    """Return the front's ends, the program and the ranges: the ends' own ranges if these are much narrower."""
    program = program_of(ranges)
    ends = _ends(program, best, solver)
    narrower = ranges_of(ends.objectives[:, : len(best)] * ranges, sizes)
    if not (narrower < OPTIONS.narrower * ranges).any():
        return ends, program, ranges
    rescaled = program_of(narrower)  # with ranges that are too wide, ends are inexact
    with suppress(Interrupted):
        return _ends(rescaled, best, solver), rescaled, narrower
    return ends, program, ranges


def _ends(program: Program, best: Points, solver: Solver) -> Solutions:
    """Return the front's ends: one objective optimal, the others nearly so.

    If no weight of the other objectives leads to an optimum, the end is the optimum of its objective alone.
    """
    count = len(best)

    def solve(x: Points, weight: float | np.ndarray, barrier: InteriorPointOptions) -> tuple[Solutions, np.ndarray]:
        weights = main_weights(count, np.arange(count), weight)
        solutions = minimise_weighted(program, x, weights, None, barrier, solver=solver)
        merit = np.sum(weights * solutions.objectives[:, :count], axis=1)
        return solutions, np.where(solutions.converged, merit, np.inf)

    ends, merit = solve(best, OPTIONS.end_tolerance, OPTIONS.warm)
    for barrier in (OPTIONS.near, OPTIONS.cold):
        again, new_merit = solve(best, OPTIONS.end_tolerance, barrier)
        better = new_merit < merit - POINT_TOLERANCE
        ends, merit = ends.replace_rows(better, again[better]), np.where(better, new_merit, merit)
    weight = OPTIONS.end_tolerance
    while not ends.converged.all() and weight < OPTIONS.end_weight:  # a flat valley: more weight makes it steeper
        weight *= 10.0
        again, _ = solve(best, weight, OPTIONS.cold)
        missing = ~ends.converged & again.converged
        ends = ends.replace_rows(missing, again[missing])
    ends = ends.replace_rows(~ends.converged, evaluate_points(program, best)[~ends.converged])
    weights = np.full(count, OPTIONS.end_weight)
    for _ in range(2):  # an objective's loss grows with the square of the others' weight
        finished = solve(ends.x, weights, OPTIONS.warm)[0]
        loss = np.diagonal(finished.objectives) - np.diagonal(ends.objectives)
        weights = weights * np.sqrt(OPTIONS.end_tolerance / np.maximum(loss, OPTIONS.end_tolerance)) / 2
        accepted = finished.converged & (loss <= OPTIONS.end_tolerance)
        if accepted.all():
            break
    return ends.replace_rows(accepted, finished[accepted])


def _add_points(sweep: Sweep, cold: ColdSearch, cold_points: int, further: int) -> None:
    """Add points between the front's ends."""
    check_interruption()
    if sweep.n_obj == 2:
        sweep.place_points(cold, cold_points, further)
        sweep.search_jumps()
    else:
        # optima from cold starts below an ε: a branch may contain no optimum of a single objective
        n_obj, ends = sweep.n_obj, sweep.objectives[: sweep.n_obj, : sweep.n_obj]
        sweep.cold_points = n_obj
        ideal, nadir = ends.min(axis=0), ends.max(axis=0)
        for main in range(n_obj):
            upper = np.where(np.arange(n_obj) == main, np.inf, nadir + OPTIONS.inner * (ideal - nadir))
            optima = cold.optima_below(sweep.program, main, upper, OPTIONS.weight)
            if optima is not None:
                sweep.add(optima[optima.converged][: OPTIONS.cold_optima])
            sweep.cold_points -= 1
        sweep.fill_gaps()
    if sweep.rounds:
        sweep.exchange_basins()

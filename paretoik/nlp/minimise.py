"""Local minima of a program from a batch of points, by a suitable or a chosen solver."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik import stop_flag
from paretoik.arrays import Point, Points
from paretoik.errors import InvalidInput, warn_user
from paretoik.nlp import sqp
from paretoik.nlp.program import (
    CONVERGED,
    FEASIBLE,
    INTERRUPTED,
    LOST,
    NO_PROGRESS,
    NOT_FINITE,
    Goal,
    InteriorPointOptions,
    Program,
    Solutions,
    Solver,
    check_solver_name,
    program_key,
    violation_of,
)
from paretoik.runs.distribution import Lost, distribute_remembered, threads, workers
from paretoik.runs.journal import Values, remembered
from paretoik.stop_flag import STOP, Interrupted, check_interruption

END = ("x", "status", "iterations", "F", "multipliers", "stationarity", "violation")  # a result's values, in order
Item: TypeAlias = tuple[Point, np.ndarray, np.ndarray, np.ndarray, InteriorPointOptions]
"""A search's start, weights, rows, upper bounds and options."""


def minimise(
    program: Program,
    x: Points,
    weights: Float[np.ndarray, "#points objectives"],
    upper: Float[np.ndarray, "#points bounds"] | None = None,
    options: InteriorPointOptions | Sequence[InteriorPointOptions] = InteriorPointOptions(),
    *,
    rows: Float[np.ndarray, "bounds objectives"] | None = None,
    solver: Solver = "auto",
    observe: Callable[[int], object] | None = None,
) -> Solutions:
    """Return the local minima that points lead to.

        minimise    weights · F(x)
        subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper (rows = I by default),  F(x) ≤ the program's own bounds

    options: settings of the solver, common or one per point
    solver: solver; "auto" is the interior-point method if the program has a kernel, else SQP
    observe: function called with the number of points that workers have finished

    A point's result does not depend on the rest of the batch. Raises InvalidInput if the interior-point method is
    chosen for a program without a kernel; after a signal, Interrupted with the solutions so far.
    """
    check_interruption()
    check_solver(program, solver)
    count, x = len(x), program.project(x)
    each = [options] * count if isinstance(options, InteriorPointOptions) else list(options)
    factors = np.broadcast_to(weights, (count, len(program.upper)))
    identity = np.eye(len(program.upper))
    if rows is None:
        table = identity
        bounds = np.broadcast_to(np.inf if upper is None else upper, (count, len(table)))
        bounds = np.minimum(bounds, program.upper)
    else:
        finite = np.isfinite(program.upper)
        table = np.concatenate([rows, identity[finite]])
        bounds = np.concatenate([upper, np.tile(program.upper[finite], (count, 1))], axis=1)
    kernel = None if solver == "sqp" else program.kernel
    solutions = _solve(program, kernel, x, factors, table, bounds, each, observe)
    # rounding errors can hide convergence
    near = (solutions.stationarity <= program.rounding) & (solutions.violation <= FEASIBLE)
    solutions.status[near & (solutions.status == NO_PROGRESS)] = CONVERGED
    return _finished(replace(solutions, x=program.pin(solutions.x)))


def chosen_solver(program: Program, solver: Solver) -> Solver:
    """Return the program's solver: for "auto" the interior-point method if it has a kernel, else SQP."""
    return "sqp" if solver == "sqp" or program.unsupported else "interior-point"


def check_solver(program: Program, solver: str) -> None:
    """Raise InvalidInput, naming the unsupported functions, if ``solver`` cannot solve the program."""
    check_solver_name(solver)
    if solver == "interior-point" and program.kernel is None:
        names = ", ".join(program.unsupported)
        raise InvalidInput(f"solver must be 'sqp' for functions that relate samples ({names}), got 'interior-point'")


def _solve(
    program: Program,
    kernel: Any,
    x: Points,
    weights: np.ndarray,
    rows: np.ndarray,
    upper: np.ndarray,
    options: Sequence[InteriorPointOptions],
    observe: Callable[[int], object] | None = None,
) -> Solutions:
    """Return the solutions from all points, by SQP if there is no kernel."""
    count, smooths = len(x), kernel is not None and bool(program.kinked)
    if smooths:
        options = [
            each._replace(
                iterations=each.kink_iterations * each.iterations,
                regularisation=each.kink_regularisation,
                flat_barrier=each.kink_flat_barrier,
            )
            for each in options
        ]
    # copies, because numba compiles again for read-only or non-contiguous arrays
    items = [(x[i].copy(), weights[i].copy(), rows, upper[i].copy(), options[i]) for i in range(count)]
    named = "SQP minimum" if kernel is None else "interior-point minimum"
    inputs = items if kernel is None else [(start, rows, factors, *others) for start, factors, _, *others in items]
    keys = [program_key(named, program, *each) for each in inputs]
    ends, remaining = [_unknown_end(program, start, INTERRUPTED) for start in x], iter(range(count))

    def work(kernel: Any) -> None:
        for i in remaining:  # a free thread takes the next point
            if STOP[0]:
                return
            ends[i] = remembered(keys[i], partial(_search, program, kernel, items[i]))

    # Python handles signals in the main thread, but not while this thread runs compiled code.
    hears_signals = stop_flag.watched or threading.current_thread() is not threading.main_thread()
    if count > 1 and workers() > 1:
        if kernel is not None:
            _compile_method(kernel, items[0])
        shared = program, kernel is not None
        with suppress(Interrupted):
            for done, (i, values) in enumerate(distribute_remembered(_search_in_worker, shared, items, keys), start=1):
                if isinstance(values, Lost):
                    warn_user(f"start {i}: {values.cause}; the others continue")
                    values = _unknown_end(program, x[i], LOST)
                ends[i] = values
                if observe is not None:
                    observe(done)
    elif kernel is None or (count == 1 and type(kernel) in _COMPILED and hears_signals):
        work(kernel)
    elif count:
        kernels = [kernel, *(program.kernel for _ in range(1, min(count, threads())))]  # one per thread
        _join([_pool().submit(work, each) for each in kernels])
        _COMPILED.add(type(kernel))
    for i in range(count if smooths else 0):
        if int(ends[i]["status"]) not in (NOT_FINITE, INTERRUPTED, LOST):
            F, equalities, inequalities = program.evaluate(ends[i]["x"])
            violation = violation_of(program, F, equalities, inequalities, rows, upper[i])
            ends[i] = {**ends[i], "F": F, "violation": np.asarray(violation)}
    return _collect(ends, x.shape, len(program.upper), upper)


def _search(program: Program, kernel: Any, item: Item) -> Values:
    """Return the result of one search as plain arrays by name, without multipliers if they are unknown."""
    start, weights, rows, upper, options = item
    if kernel is None:
        settings = sqp.SqpOptions(radius=options.radius, iterations=options.iterations, tolerance=options.tolerance)
        solution = sqp.minimise(program, start, Goal(weights=weights, rows=rows, upper=upper), settings)
        point = solution.x, solution.status, solution.iterations, solution.objectives
        end = (*point, solution.bound_multipliers, solution.stationarity, solution.violation)
    else:
        from paretoik.nlp.banded.interior_point import minimise as search  # here: numba

        end = search(kernel, *item, STOP)
    return {name: np.asarray(value) for name, value in zip(END, end, strict=True) if value is not None}


def _search_in_worker(shared: tuple[Program, bool], item: Item) -> Values:
    program, is_compiled = shared
    return _search(program, program.kernel if is_compiled else None, item)


def _unknown_end(program: Program, start: Point, status: int) -> Values:
    """Return the result of a search that did not run or failed."""
    unknown = {"iterations": 0, "F": np.full(len(program.upper), np.nan), "stationarity": np.nan, "violation": np.nan}
    return {"x": start, "status": np.asarray(status), **{name: np.asarray(value) for name, value in unknown.items()}}


def _collect(
    ends: Sequence[Values], shape: tuple[int, ...], objectives: int, upper: Float[np.ndarray, "points bounds"]
) -> Solutions:
    """Return results of searches as a batch; the last multipliers of each are those of finite bounds."""

    def column(name: str, kind: type = float) -> np.ndarray:
        return np.array([end[name] for end in ends], dtype=kind)

    finite = np.isfinite(upper)
    bound_multipliers = np.where(finite, np.nan, 0.0)
    for row, columns, end in zip(bound_multipliers, finite, ends, strict=True):
        if "multipliers" in end:
            row[columns] = end["multipliers"][len(end["multipliers"]) - columns.sum() :]
    return Solutions(
        x=column("x").reshape(shape),
        status=column("status", int),
        iterations=column("iterations", int),
        objectives=column("F").reshape(len(ends), objectives),
        bound_multipliers=bound_multipliers,
        stationarity=column("stationarity"),
        violation=column("violation"),
    )


def compile_method(
    program: Program,
    x: Point,
    weights: Float[np.ndarray, "1 objectives"],
    options: InteriorPointOptions,
    *,
    solver: Solver,
) -> None:
    """Compile the interior-point method for a program if necessary; workers then load it from disk."""
    kernel = None if solver == "sqp" else program.kernel
    if kernel is not None:
        size = len(program.upper)
        start = x.copy(), np.broadcast_to(weights, (1, size))[0].copy(), np.eye(size)
        _compile_method(kernel, (*start, program.upper.copy(), options))


def _compile_method(kernel: Any, item: Item) -> None:
    from paretoik.nlp.banded.interior_point import minimise as search  # here: numba

    if type(kernel) not in _COMPILED:
        search(kernel, *item[:-1], item[-1]._replace(iterations=0), STOP)
        _COMPILED.add(type(kernel))


_COMPILED: set[type] = set()  # classes of kernels whose method is compiled; signals do not end compilations


def _join(futures: list[Future[None]], *, interval: float = 0.25) -> None:
    """Wait for all; raise Interrupted if one runs on for ``interval`` [s] after a signal, as compilations can."""
    pending = set(futures)
    while pending:
        stopping = bool(STOP[0])
        pending = wait(pending, timeout=interval).not_done
        if pending and stopping:
            raise Interrupted
    for future in futures:
        future.result()


@cache
def _pool() -> ThreadPoolExecutor:
    """Return the process's threads, one per core; they run at once, as compiled code releases Python's lock."""
    return ThreadPoolExecutor(threads())


os.register_at_fork(after_in_child=_pool.cache_clear)  # a fork does not copy threads


def minimise_violation(
    program: Program,
    x: Points,
    upper: Float[np.ndarray, " objectives"],
    options: Sequence[InteriorPointOptions],
) -> Solutions:
    """Return the local minima of the violation of limits and bounds.

        minimise    Σ t (interior-point method) or max t (SQP),  t ≥ 0
        subject to  h(x) = 0,  c(x) + t ≥ 0,  F(x) ≤ min(upper, the program's own bounds) + t

    The points use the ``options`` cyclically. Converged points violate nothing.
    """
    check_interruption()
    bounds = np.tile(np.minimum(upper, program.upper), (len(x), 1))
    weights, identity = np.zeros_like(bounds), np.eye(len(program.upper))
    each, kernel = [options[i % len(options)] for i in range(len(x))], program.kernel
    starts = x if kernel is None else program.project(x)
    return _finished(_solve(program, kernel, starts, weights, identity, bounds, each))


def _finished(solutions: Solutions) -> Solutions:
    """Return the solutions, or raise Interrupted with them if a signal ended some searches."""
    if (solutions.status == INTERRUPTED).any():
        raise Interrupted(solutions)
    return solutions

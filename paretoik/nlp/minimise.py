"""Local minima of a program from a batch of points, by a suitable or a chosen solver."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik import stop_flag
from paretoik.arrays import Point, Points
from paretoik.errors import InvalidInput, warn_user
from paretoik.nlp import sqp
from paretoik.nlp.program import (
    CONVERGED,
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

# Results of searches as plain arrays: from the run's journal, from workers, and as a batch of solutions.


END = ("x", "status", "iterations", "F", "multipliers", "stationarity", "violation")


def remembered_end(key: bytes | None, search: Callable[[], tuple[Any, ...]]) -> tuple[Any, ...]:
    """Return the result of a search, from the run's journal if it is there."""
    return search() if key is None else end_of(remembered(key, lambda: values_of_end(search())))


def values_of_end(end: tuple[Any, ...]) -> Values:
    """Return the result of a search as plain arrays by name."""
    return {name: np.asarray(value) for name, value in zip(END, end, strict=True) if value is not None}


def end_of(values: Values) -> tuple[Any, ...]:
    """Return the result of a search from plain arrays by name."""
    end = {name: values[name] if values[name].ndim else values[name].item() for name in END if name in values}
    return tuple(end.get(name) for name in END)


def unknown_end(program: Program, start: np.ndarray, status: int) -> tuple[Any, ...]:
    """Return the result of a search that was not made or failed."""
    return start, status, 0, np.full(len(program.upper), np.nan), None, np.nan, np.nan


def distribute_searches(
    search: Callable[[Program, Any], Values],
    program: Program,
    starts: Sequence[tuple[Any, ...]],
    keys: Sequence[bytes | None],
    ends: list[tuple[Any, ...]],
    observe: Callable[[int], object] | None,
) -> None:
    """Write the results of workers' searches to ``ends`` as they arrive; after a signal the others stay."""
    with suppress(Interrupted):
        for done, (i, values) in enumerate(distribute_remembered(search, program, starts, keys), start=1):
            if isinstance(values, Lost):
                warn_user(f"start {i}: {values.cause}; the others go on")
                ends[i] = unknown_end(program, starts[i][0], LOST)
            else:
                ends[i] = end_of(values)
            if observe is not None:
                observe(done)


def collect_solutions(
    ends: Sequence[tuple[Any, ...]], shape: tuple[int, ...], objectives: int, upper: Float[np.ndarray, "points bounds"]
) -> Solutions:
    """Return results of searches as a batch of points with this ``shape``.

    A result is (x, status, iterations, F, multipliers, stationarity, violation). The last multipliers are those of the
    finite bounds; None if they are unknown.
    """
    x, status, iterations, F, multipliers, stationarity, violation = list(zip(*ends, strict=True)) or [()] * 7
    finite = np.isfinite(upper)
    bound_multipliers = np.where(finite, np.nan, 0.0)
    for row, columns, values in zip(bound_multipliers, finite, multipliers, strict=True):
        if values is not None:
            row[columns] = values[len(values) - columns.sum() :]
    return Solutions(
        x=np.array(x).reshape(shape),
        status=np.array(status, dtype=int),
        iterations=np.array(iterations, dtype=int),
        objectives=np.array(F).reshape(len(ends), objectives),
        bound_multipliers=bound_multipliers,
        stationarity=np.array(stationarity, dtype=float),
        violation=np.array(violation, dtype=float),
    )


# Local minima from a batch of points, by any solver.


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
        subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper (F itself without rows),  F(x) ≤ the program's own bounds

    A point's result does not depend on the rest of the batch; ``options`` are common, or one per point. "auto" is the
    interior-point method if the program has a kernel, else SQP. ``observe`` gets the number of points that workers have
    finished.

    Raises InvalidInput if the interior-point method is chosen for a program without a kernel, and Interrupted, with
    the solutions so far, after a signal.
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
    if kernel is None:
        solutions = _sqp(program, x, factors, table, bounds, each, observe)
    else:
        solutions = _interior_point(program, kernel, x, factors, table, bounds, each, observe)
    # Below the program's own rounding no step improves a point.
    near = (solutions.stationarity <= program.rounding) & (solutions.violation <= 1e-8)
    solutions.status[near & (solutions.status == NO_PROGRESS)] = CONVERGED
    return _finished(replace(solutions, x=program.pin(solutions.x)))


def chosen_solver(program: Program, solver: Solver) -> Solver:
    """Return the program's solver: "auto" is "interior-point" if it has a kernel, else "sqp"."""
    return "sqp" if solver == "sqp" or program.unsupported else "interior-point"


def check_solver(program: Program, solver: str) -> None:
    """Raise InvalidInput unless ``solver`` can solve the program, naming the unsupported functions."""
    check_solver_name(solver)
    if solver == "interior-point" and program.kernel is None:
        names = ", ".join(program.unsupported)
        raise InvalidInput(f"solver must be 'sqp' for functions that relate samples ({names}), got 'interior-point'")


def _interior_point(
    program: Program,
    kernel: Any,
    x: np.ndarray,
    weights: np.ndarray,
    rows: np.ndarray,
    upper: np.ndarray,
    options: Sequence[InteriorPointOptions],
    observe: Callable[[int], object] | None,
) -> Solutions:
    from paretoik.nlp.banded.interior_point import minimise as search  # here: numba

    count = len(x)
    if program.kinked:
        options = [
            each._replace(
                iterations=each.kink_iterations * each.iterations,
                regularisation=each.kink_regularisation,
                flat_barrier=each.kink_flat_barrier,
            )
            for each in options
        ]
    ends = [unknown_end(program, start, INTERRUPTED) for start in x]
    points = zip(x, weights, upper, options, strict=True)
    keys = [program_key("interior-point minimum", program, start, rows, *inputs) for start, *inputs in points]
    remaining = iter(range(count))

    def start_of(i: int) -> tuple[Any, ...]:
        return np.ascontiguousarray(x[i]), weights[i].copy(), rows, upper[i].copy(), options[i]

    def work(kernel: Any) -> None:
        for i in remaining:  # a free thread takes the next point
            if STOP[0]:
                return
            ends[i] = remembered_end(keys[i], partial(search, kernel, *start_of(i), STOP))

    if count > 1 and workers() > 1:
        _compile_method(kernel, start_of(0))
        distribute_searches(_interior_point_end, program, [start_of(i) for i in range(count)], keys, ends, observe)
    elif count == 1 and type(kernel) in _COMPILED and _hears_signals():
        work(kernel)
    elif count:
        kernels = [kernel, *(program.kernel for _ in range(1, min(count, threads())))]  # one per thread
        _join([_pool().submit(work, each) for each in kernels])
        _COMPILED.add(type(kernel))
    for i in range(count if program.kinked else 0):  # the solver minimised smoothed functions
        if ends[i][1] not in (NOT_FINITE, INTERRUPTED, LOST):
            F, equalities, inequalities = program.evaluate(ends[i][0])
            violation = violation_of(program, F, equalities, inequalities, rows, upper[i])
            ends[i] = (*ends[i][:3], F, *ends[i][4:6], violation)
    return collect_solutions(ends, x.shape, len(program.upper), upper)


def compile_method(
    program: Program,
    x: Point,
    weights: Float[np.ndarray, "1 objectives"],
    options: InteriorPointOptions,
    *,
    solver: Solver,
) -> None:
    """Compile the method for a program if necessary; workers then load it from the disk."""
    kernel = None if solver == "sqp" else program.kernel
    if kernel is not None:
        size = len(program.upper)
        start = np.ascontiguousarray(x), np.broadcast_to(weights, (1, size))[0].copy(), np.eye(size)
        _compile_method(kernel, (*start, program.upper.copy(), options))


def _compile_method(kernel: Any, start: tuple[Any, ...]) -> None:
    from paretoik.nlp.banded.interior_point import minimise as search  # here: numba

    if type(kernel) not in _COMPILED:
        search(kernel, *start[:-1], start[-1]._replace(iterations=0), STOP)
        _COMPILED.add(type(kernel))


_COMPILED: set[type] = set()  # kernels whose interior-point method is compiled: no signal ends a compilation


def _hears_signals() -> bool:
    """Return whether a signal is noticed while this thread runs compiled code.

    Python handles signals in the main thread, between its own instructions.
    """
    return stop_flag.watched or threading.current_thread() is not threading.main_thread()


def _join(futures: list[Future[None]], *, interval: float = 0.25) -> None:
    """Wait for all; after a signal wait only ``interval`` [s] longer, as code may still compile.

    Raises Interrupted if some have not ended by then.
    """
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
    """Return threads, one per core, for the life of the process: compiled code releases Python's lock."""
    return ThreadPoolExecutor(threads())


os.register_at_fork(after_in_child=_pool.cache_clear)  # a fork does not copy threads


def _sqp(
    program: Program,
    x: np.ndarray,
    weights: np.ndarray,
    rows: np.ndarray,
    upper: np.ndarray,
    options: Sequence[InteriorPointOptions],
    observe: Callable[[int], object] | None = None,
) -> Solutions:
    ends = [unknown_end(program, start, INTERRUPTED) for start in x]
    starts, keys = list[tuple[Any, ...]](), list[bytes | None]()
    for start, factors, bounds, each in zip(x, weights, upper, options, strict=True):
        settings = sqp.SqpOptions(radius=each.radius, iterations=each.iterations, tolerance=each.tolerance)
        starts.append((start, Goal(weights=factors, rows=rows, upper=bounds), settings))
        keys.append(program_key("SQP minimum", program, start, factors, rows, bounds, each))
    if len(x) > 1 and workers() > 1:
        distribute_searches(_sqp_end, program, starts, keys, ends, observe)
        return collect_solutions(ends, x.shape, len(program.upper), upper)
    for i, one in enumerate(starts):
        if STOP[0]:
            break
        ends[i] = remembered_end(keys[i], partial(_solve_by_sqp, program, *one))
    return collect_solutions(ends, x.shape, len(program.upper), upper)


def _solve_by_sqp(program: Program, start: np.ndarray, goal: Goal, settings: sqp.SqpOptions) -> tuple[Any, ...]:
    end = sqp.minimise(program, start, goal, settings)
    point = end.x, end.status, end.iterations, end.objectives
    return (*point, end.bound_multipliers, end.stationarity, end.violation)


def _interior_point_end(program: Program, start: tuple[Any, ...]) -> Values:
    from paretoik.nlp.banded.interior_point import minimise as search  # here: numba

    return values_of_end(search(program.kernel, *start, STOP))


def _sqp_end(program: Program, start: tuple[np.ndarray, Goal, sqp.SqpOptions]) -> Values:
    return values_of_end(_solve_by_sqp(program, *start))


def minimise_violation(
    program: Program,
    x: Points,
    upper: Float[np.ndarray, " objectives"],
    options: Sequence[InteriorPointOptions],
) -> Solutions:
    """Return the local minima of the violation of limits and bounds.

        minimise    Σ t (interior-point method) or max t (SQP),  t ≥ 0
        subject to  h(x) = 0,  c(x) + t ≥ 0,  F(x) ≤ min(upper, the program's own bounds) + t

    The points use the ``options`` cyclically. Points that converged violate nothing.
    """
    check_interruption()
    bounds = np.tile(np.minimum(upper, program.upper), (len(x), 1))
    weights, identity = np.zeros_like(bounds), np.eye(len(program.upper))
    each, kernel = [options[i % len(options)] for i in range(len(x))], program.kernel
    if kernel is None:
        return _finished(_sqp(program, x, weights, identity, bounds, each))
    return _finished(_interior_point(program, kernel, program.project(x), weights, identity, bounds, each, None))


def _finished(solutions: Solutions) -> Solutions:
    """Return solutions; raise Interrupted, with them, if a signal ended some of the searches."""
    if (solutions.status == INTERRUPTED).any():
        raise Interrupted(solutions)
    return solutions

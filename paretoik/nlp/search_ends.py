"""The ends of searches as plain arrays: from the journal of the run, from workers, and as a batch of solutions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.distribution import Lost, distribute_remembered
from paretoik.journal import Values, remembered
from paretoik.nlp.program import Program
from paretoik.nlp.solutions import LOST, Solutions
from paretoik.stop_flag import Interrupted
from paretoik.user_warnings import warn_user

END = ("x", "status", "iterations", "F", "multipliers", "stationarity", "violation")


def remembered_end(key: bytes | None, search: Callable[[], tuple[Any, ...]]) -> tuple[Any, ...]:
    """Return the end of a search, from the run's journal where it is there."""
    return search() if key is None else end_of(remembered(key, lambda: values_of_end(search())))


def values_of_end(end: tuple[Any, ...]) -> Values:
    """Return the end of a search as plain arrays by name."""
    return {name: np.asarray(value) for name, value in zip(END, end, strict=True) if value is not None}


def end_of(values: Values) -> tuple[Any, ...]:
    """Return plain arrays by name as the end of a search."""
    end = {name: values[name] if values[name].ndim else values[name].item() for name in END if name in values}
    return tuple(end.get(name) for name in END)


def unknown_end(program: Program, start: np.ndarray, status: int) -> tuple[Any, ...]:
    """Return the end of a search that was not made, or of which nothing came."""
    return start, status, 0, np.full(len(program.upper), np.nan), None, np.nan, np.nan


def distribute_searches(
    search: Callable[[Program, Any], Values],
    program: Program,
    starts: Sequence[tuple[Any, ...]],
    keys: Sequence[bytes | None],
    ends: list[tuple[Any, ...]],
    observe: Callable[[int], object] | None,
) -> None:
    """Put in place what searches of workers end at, as they end: after a signal the others stay as they were."""
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
    """Return ends as a batch of points of a ``shape``: x, status, iterations, F, multipliers, stationarity, violation.

    Of the multipliers the last are those of the finite bounds; None where they are unknown.
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

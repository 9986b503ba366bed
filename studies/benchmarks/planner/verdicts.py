"""Ours compared with a peer's: ratios and goals, losses first."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from studies.reporting import Row

LOSS = "LOSS: "
HALF = 0.5


def versus(
    *,
    table: str,
    row: str,
    column: str,
    unit: str,
    ours: float,
    theirs: float,
    goal: float | None = None,
    source: str = "peer",
    note: str = "",
) -> Row:
    """Return a row whose note has the ratio of ours to theirs and the goal, if there is one; less is better."""
    ratio = ours / theirs if np.isfinite(theirs) and theirs > 0 else (0.0 if np.isfinite(ours) else np.inf)
    lost = goal is not None and not ratio <= goal
    parts = [f"ratio {ratio:.3g}", *([f"goal {goal:g}"] if goal is not None else []), *([note] if note else [])]
    finite_theirs = float(theirs) if np.isfinite(theirs) else None
    return Row(
        table=table,
        row=row,
        column=column,
        unit=unit,
        ours=float(ours),
        reference=finite_theirs,
        source=source,
        note=(LOSS if lost else "") + ", ".join(parts),
    )


def losses_first(rows: Sequence[Row]) -> list[Row]:
    """Return the rows, tables with a loss first and losses first in each."""
    return sorted(rows, key=lambda row: not row.note.startswith(LOSS))


def timed(work: Callable[[], Any]) -> tuple[Any, float, float]:
    """Return the result of work, its seconds, and the processor's, of all threads."""
    started, cpu = time.perf_counter(), time.process_time()
    result = work()
    return result, time.perf_counter() - started, time.process_time() - cpu

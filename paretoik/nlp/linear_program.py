"""The linear program of a directional maximum: how far sums of columns, each within its range, reach along a direction.

maximise    v
subject to  columns · x = v · direction, low ≤ x ≤ high

Solved by SciPy's HiGHS, whose simplex ends on a vertex, exact to rounding, where interior points stop short of it.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.optimize import linprog

from paretoik.errors import SolverFailed


def furthest(
    columns: Float[np.ndarray, "task columns"],
    low: Float[np.ndarray, " columns"],
    high: Float[np.ndarray, " columns"],
    direction: Float[np.ndarray, " task"],
) -> tuple[float, Float[np.ndarray, " columns"]]:
    """Return how far the columns reach along a direction, v, and the multiples x that do.

    Raises SolverFailed where there is no such point, or no end to it.
    """
    scale = np.maximum(np.abs(low), np.abs(high))
    scale = np.where(scale > 0, scale, 1.0)
    steps = columns * scale
    size = float(np.abs(steps).max(initial=0.0)) or 1.0
    solution = linprog(
        np.append(np.zeros(len(low)), -1.0),
        A_eq=np.column_stack([steps / size, -direction]),
        b_eq=np.zeros(len(direction)),
        bounds=[*zip(low / scale, high / scale, strict=True), (0.0, None)],
        method="highs-ds",
    )
    if solution.status != 0:
        raise SolverFailed(f"furthest: HiGHS wanted to end with an optimum, got {solution.message}")
    return float(solution.x[-1]) * size, solution.x[:-1] * scale

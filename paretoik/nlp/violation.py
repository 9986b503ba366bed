"""By how much a point violates what a program bounds."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from paretoik.nlp.program import Linearisation, Program


def violation_at(program: Program, at: Linearisation) -> float:
    """Return the worst violation of equalities, limits and bounds at a point, as a share of their ranges."""
    return violation_of(program, at.objectives, at.equalities, at.inequalities[: at.elastic])


def violation_of(
    program: Program,
    objectives: Float[np.ndarray, " n_obj"],
    equalities: Float[np.ndarray, " equalities"],
    inequalities: Float[np.ndarray, " elastic"],
    rows: Float[np.ndarray, "bounds n_obj"] | None = None,
    upper: Float[np.ndarray, " bounds"] | None = None,
) -> float:
    """Return the worst violation where F, h and the elastic part of c have these values; NaN where one of them is.

    Bounded are rows · F ≤ ``upper``; without rows F itself, by the program's own bounds.
    """
    if rows is None or upper is None:
        rows, upper = np.eye(len(objectives)), program.upper
    finite = np.isfinite(upper)
    excess = rows[finite] @ objectives - upper[finite]
    return float(np.concatenate([[0.0], np.abs(equalities), -inequalities, excess]).max())

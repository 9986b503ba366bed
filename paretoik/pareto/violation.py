"""By how much a point violates what a program bounds."""

from __future__ import annotations

import numpy as np

from paretoik.nlp.program import Linearisation, Program


def violation_at(program: Program, at: Linearisation) -> float:
    """Return the worst violation of equalities, limits and bounds at a point, as a share of their ranges."""
    return violation_of(program, at.objectives, at.equalities, at.inequalities[: at.elastic])


def violation_of(program: Program, objectives: np.ndarray, equalities: np.ndarray, inequalities: np.ndarray) -> float:
    """Return the worst violation where F, h and the elastic part of c have these values."""
    bounds = float((objectives - program.upper).max(initial=-np.inf))
    return max(0.0, float(np.abs(equalities).max(initial=0.0)), -float(inequalities.min(initial=0.0)), bounds)

"""The evaluation of a batch of rows: where that fails, row by row."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np

from paretoik.arrays import Genes
from paretoik.errors import InvalidInput
from paretoik.search.ask_tell import Outcome

Evaluate: TypeAlias = Callable[[Genes], Mapping[str, Any]]


def evaluate_rows(problem: Any, evaluate: Evaluate, X: Genes) -> Outcome:
    """Evaluate a batch; if that raises, each row by itself: functions of users may raise anything, for any row."""
    try:
        return Outcome.of(problem, evaluate(X.copy()), len(X))
    except InvalidInput:
        raise
    except Exception:
        outcome = Outcome.of(problem, {}, len(X))
    for row in range(len(X)):
        try:
            alone = Outcome.of(problem, evaluate(X[row : row + 1].copy()), 1)
            outcome.F[row], outcome.G[row], outcome.H[row] = alone.F[0], alone.G[0], alone.H[0]
            if alone.causes:
                outcome.causes[row] = alone.causes[0]
        except Exception as error:
            outcome.F[row] = np.nan
            outcome.causes[row] = f"{type(error).__name__}: {' '.join(str(error).split())}"
    return outcome

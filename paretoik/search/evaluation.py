"""The evaluation of a batch of rows: where that fails, row by row."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Int

from paretoik.arrays import Genes
from paretoik.errors import EvaluationFailed
from paretoik.search.candidates import Outcome
from paretoik.user_functions import user_function

Rows: TypeAlias = Int[np.ndarray, " _"]  # numbers of rows, as many as there are
Evaluate: TypeAlias = Callable[[Genes], Mapping[str, Any]]


def evaluate_rows(problem: Any, evaluate: Evaluate, X: Genes) -> Outcome:
    """Evaluate a batch; if that raises, each row by itself: functions of users may raise anything, for any row."""
    try:
        with user_function("the problem"):
            return Outcome.of(problem, evaluate(X.copy()), len(X))
    except EvaluationFailed as failure:
        if len(X) <= 1:
            return replace(Outcome.of(problem, {}, len(X)), causes=dict.fromkeys(range(len(X)), str(failure)))
    return joined([(np.array([row]), evaluate_rows(problem, evaluate, X[row : row + 1])) for row in range(len(X))])[1]


def joined(parts: Sequence[tuple[Rows, Outcome]]) -> tuple[Rows, Outcome]:
    """Return rows in order, each once, and their outcome."""
    if len(parts) == 1:
        return parts[0]
    rows = np.concatenate([rows for rows, _ in parts])
    order = np.unique(rows, return_index=True)[1]
    F, G, H = (np.concatenate([getattr(part, name) for _, part in parts])[order] for name in ("F", "G", "H"))
    causes = {int(rows[i]): cause for rows, part in parts for i, cause in part.causes.items()}
    rows = rows[order]
    return rows, Outcome(F=F, G=G, H=H, causes={i: causes[row] for i, row in enumerate(rows.tolist()) if row in causes})

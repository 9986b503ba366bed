"""The evaluation of a batch of rows: where that fails, row by row."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Int

from paretoik.arrays import Genes
from paretoik.errors import EvaluationFailed, InvalidInput
from paretoik.search.candidates import Outcome
from paretoik.user_functions import cause_of, limited_call, user_function

Rows: TypeAlias = Int[np.ndarray, " _"]  # numbers of rows, as many as there are
Evaluate: TypeAlias = Callable[[Genes], Mapping[str, Any]]


def evaluate_problem(problem: Any, X: Genes) -> Mapping[str, Any]:
    """Return what a pymoo problem evaluates to; raises InvalidInput for values that pymoo would falsify.

    pymoo drops masks and imaginary parts, and reads numbers from text.
    """
    is_covered = "_evaluate" in vars(problem) or not hasattr(problem, "_evaluate")
    if not is_covered:
        problem._evaluate = _CheckedEvaluation(problem)
    try:
        values: Mapping[str, Any] = problem.evaluate(X, return_as_dictionary=True)
        return values
    finally:
        if not is_covered:
            del problem._evaluate


@dataclass(frozen=True)
class _CheckedEvaluation:
    """The ``_evaluate`` of a problem, whose values are checked before pymoo reads them."""

    problem: Any

    def __call__(self, x: Any, out: dict[str, Any], *arguments: Any, **named: Any) -> None:
        """Evaluate; raises InvalidInput for values that are not real numbers."""
        type(self.problem)._evaluate(self.problem, x, out, *arguments, **named)
        for name in ("F", "G", "H"):
            for values in out[name] if isinstance(out.get(name), list | tuple) else [out.get(name)]:
                _check_real(f"problem {type(self.problem).__name__}: {name}", values)


def _check_real(name: str, values: Any) -> None:
    """Raise InvalidInput, by ``name``, for masked, complex and textual values; pymoo checks their shape."""
    try:
        kind = np.asarray(values).dtype.kind
    except Exception as error:  # a foreign array may raise anything
        raise InvalidInput(f"{name}: must hold real numbers, got {cause_of(error)}") from None
    if np.ma.is_masked(values) or kind not in "fiubO":
        fact = "masked ones" if np.ma.is_masked(values) else "complex ones" if kind == "c" else "text"
        raise InvalidInput(f"{name}: must hold real numbers, got {fact}")


def evaluate_rows(problem: Any, evaluate: Evaluate, X: Genes) -> Outcome:
    """Evaluate a batch; if that raises, each row by itself: functions of users may raise anything, for any row."""
    try:
        ours = type(problem).__module__.startswith("paretoik.")  # whose users' functions are limited one by one
        with user_function("the problem"), nullcontext() if ours else limited_call("the problem"):
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

"""The evaluation of what a search asks for: failures by row, and what is known from the journal of a run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from pymoo.core.problem import LoopedElementwiseEvaluation

from paretoik.arrays import Genes, Objectives
from paretoik.errors import EvaluationFailed, InvalidRun
from paretoik.journal import key_of, remembered
from paretoik.search.ask_tell import Candidates, Outcome, Search
from paretoik.stop_flag import check_interruption
from paretoik.user_functions import user_function

Evaluate: TypeAlias = Callable[[Genes], Mapping[str, Any]]


@dataclass(frozen=True, kw_only=True)
class EvaluationOptions:
    """Rows that a problem evaluates one by one go into the journal after so many ``seconds``, not all at once."""

    seconds: float = 0.5


OPTIONS = EvaluationOptions()


def evaluate_candidates(search: Search, candidates: Candidates, evaluate: Evaluate) -> Outcome:
    """Return the outcome of a generation, from the run's journal where it is there.

    Raises InvalidRun where the journal has that of other genes: then the search does not repeat itself. Where a problem
    evaluates rows one by one, raises Interrupted soon after a signal; what was evaluated by then is in the journal.
    """
    genes = np.frombuffer(key_of("genes", candidates.X), np.uint8)
    of = search.names, search.seed, candidates.generation

    def compute() -> dict[str, np.ndarray]:
        return _table(_evaluate_in_parts(search.problem, evaluate, candidates.X, of)) | {"genes": genes}

    values = remembered(key_of("generation", *of), compute)
    if not np.array_equal(values["genes"], genes):
        raise InvalidRun(
            f"generation {candidates.generation + 1}: wanted the genes that the journal of the run has, got others: "
            "the problem, a library's version or the processor is another"
        )
    return _outcome(values)


def evaluate_again(search: Search, candidates: Candidates, evaluate: Evaluate) -> Objectives:
    """Return F of the first row of a generation, evaluated once more; from the run's journal where it is there."""

    def compute() -> dict[str, np.ndarray]:
        return _table(evaluate_rows(search.problem, evaluate, candidates.X[:1]))

    return remembered(key_of("again", search.names, search.seed, candidates.generation), compute)["F"]


def evaluate_rows(problem: Any, evaluate: Evaluate, X: Genes) -> Outcome:
    """Evaluate a batch; if that raises, each row by itself: functions of users may raise anything, for any row."""
    try:
        with user_function("the problem"):
            return Outcome.of(problem, evaluate(X.copy()), len(X))
    except EvaluationFailed as failure:
        if len(X) == 1:
            return replace(Outcome.of(problem, {}, 1), causes={0: str(failure)})
    return _concatenate([evaluate_rows(problem, evaluate, X[row : row + 1]) for row in range(len(X))])


def _evaluate_in_parts(problem: Any, evaluate: Evaluate, X: Genes, of: tuple[object, ...]) -> Outcome:
    """Return the outcome of all rows; where they are evaluated one by one, remembered in parts."""
    runner = getattr(problem, "elementwise_runner", None)
    if not (getattr(problem, "elementwise", False) and isinstance(runner, LoopedElementwiseEvaluation)):
        return evaluate_rows(problem, evaluate, X)
    parts = list[Outcome]()
    while (first := sum(len(part.F) for part in parts)) < len(X):
        rows = X[first:]
        key = key_of("rows", *of, first, rows)
        parts.append(_outcome(remembered(key, partial(_evaluate_part, problem, evaluate, rows))))
        check_interruption()
    return _concatenate(parts) if parts else evaluate_rows(problem, evaluate, X)


def _evaluate_part(problem: Any, evaluate: Evaluate, X: Genes) -> dict[str, np.ndarray]:
    """Return the outcome of the first row, and of as many more as may be done in the time that a part takes."""
    begin = time.monotonic()
    first = evaluate_rows(problem, evaluate, X[:1])
    count = int(min((OPTIONS.seconds / max(time.monotonic() - begin, 1e-9)) - 1, len(X) - 1))
    return _table(_concatenate([first, evaluate_rows(problem, evaluate, X[1 : 1 + count])]) if count > 0 else first)


def _concatenate(parts: list[Outcome]) -> Outcome:
    F, G, H = (np.concatenate([getattr(part, name) for part in parts]) for name in ("F", "G", "H"))
    offsets = np.cumsum([0, *(len(part.F) for part in parts)]).tolist()
    pairs = zip(offsets, parts, strict=False)
    return Outcome(F=F, G=G, H=H, causes={at + row: cause for at, part in pairs for row, cause in part.causes.items()})


def _table(outcome: Outcome) -> dict[str, np.ndarray]:
    """Return an outcome as plain arrays."""
    failed, causes = np.array(list(outcome.causes), dtype=np.int64), np.array(list(outcome.causes.values()), np.str_)
    return {"F": outcome.F, "G": outcome.G, "H": outcome.H, "failed": failed, "causes": causes}


def _outcome(values: Mapping[str, np.ndarray]) -> Outcome:
    """Return plain arrays as an outcome."""
    causes = dict(zip(values["failed"].tolist(), values["causes"].tolist(), strict=True))
    return Outcome(F=values["F"], G=values["G"], H=values["H"], causes=causes)

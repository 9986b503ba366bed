"""The evaluation of a generation, in this process or in workers, from the journal of the run as far as that goes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pymoo.core.problem import LoopedElementwiseEvaluation

from paretoik.arrays import Genes, Objectives
from paretoik.distribution import Lost, distribute, workers
from paretoik.errors import InvalidRun
from paretoik.journal import Values, key_of, recalled, remembered
from paretoik.search.ask_tell import Search
from paretoik.search.candidates import Candidates, Outcome
from paretoik.search.evaluation import Evaluate, Rows, evaluate_rows, joined
from paretoik.search.islands import Islands
from paretoik.stop_flag import check_interruption
from paretoik.user_warnings import warn_user


@dataclass(frozen=True, kw_only=True)
class EvaluationOptions:
    """What is evaluated goes into the journal after so many ``seconds``, or half of them, not with its generation.

    Workers are given ``rows`` at a time of a problem that takes many at once, however many workers there are.
    """

    seconds: float = 0.5
    rows: int = 8


OPTIONS = EvaluationOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Evaluation:
    """How rows of a ``problem`` are evaluated: by what function, and in how many ``seconds`` each, in workers."""

    problem: Any
    evaluate: Evaluate
    seconds: float | None = None

    @property
    def is_row_by_row(self) -> bool:
        """Whether the problem itself looks at one row after the other."""
        return _elementwise(self.problem) and isinstance(self.problem.elementwise_runner, LoopedElementwiseEvaluation)

    @property
    def rows_of_a_task(self) -> int:
        """Number of rows that workers are given at a time, whose time is taken together."""
        return 1 if self.is_row_by_row or self.seconds is not None else OPTIONS.rows

    @property
    def has_own_runner(self) -> bool:
        """Whether the problem itself has its rows evaluated elsewhere."""
        return _elementwise(self.problem) and not self.is_row_by_row


def evaluate_candidates(search: Search | Islands, candidates: Candidates, evaluation: Evaluation) -> Outcome:
    """Return the outcome of a generation, from the run's journal where it is there.

    Raises InvalidRun where the journal has that of other genes: then the search does not repeat itself. Where rows are
    evaluated in workers, or by the problem one by one, raises Interrupted soon after a signal; what was evaluated by
    then is in the journal.
    """
    genes = np.frombuffer(key_of("genes", candidates.X), np.uint8)
    of = search.names, search.seed, candidates.generation

    def compute() -> Values:
        if candidates.generation == 0:
            _check_rows_alone(evaluation, candidates.X)
        return _table(_evaluate(evaluation, candidates.X, of)) | {"genes": genes}

    values = remembered(key_of("generation", *of), compute)
    if not np.array_equal(values["genes"], genes):
        raise InvalidRun(
            f"generation {candidates.generation + 1}: wanted the genes that the journal of the run has, got others: "
            "the problem, a library's version or the processor is another"
        )
    return _outcome(values)


def evaluate_again(search: Search | Islands, candidates: Candidates, evaluation: Evaluation) -> Objectives:
    """Return F of the first row of a generation, evaluated once more; from the run's journal where it is there."""
    of = search.names, search.seed, candidates.generation, "again"

    def compute() -> Values:
        return _table(_evaluate(evaluation, candidates.X[:1], of))

    return remembered(key_of("again", search.names, search.seed, candidates.generation), compute)["F"]


@dataclass(kw_only=True, eq=False)
class _Parts:
    """What is known of a generation's ``size`` rows, part by part; the last ``new`` ones are not in the journal yet."""

    key: Callable[[int], bytes]
    size: int
    done: list[tuple[Rows, Outcome]] = field(default_factory=list)
    remembered: int = 0
    new: int = 0
    since: float = field(default_factory=time.monotonic)

    @property
    def remaining(self) -> Rows:
        """The rows that are not known."""
        return np.setdiff1d(np.arange(self.size), np.concatenate([[], *(rows for rows, _ in self.done)])).astype(int)

    def recall(self) -> None:
        """Take what the journal has."""
        while (values := recalled(self.key(self.remembered))) is not None:
            self.done.append((values["rows"], _outcome(values)))
            self.remembered += 1

    def add(self, rows: Rows, outcome: Outcome) -> None:
        """Take the outcome of some rows; after some time it goes into the journal."""
        self.done.append((rows, outcome))
        self.new += 1
        if time.monotonic() - self.since >= OPTIONS.seconds / 2:
            self.remember()

    def remember(self) -> None:
        """Let the journal have what is new, unless all is known: that is remembered as a generation."""
        self.since = time.monotonic()
        if self.new and len(self.remaining):
            rows, outcome = joined(self.done[-self.new :])
            remembered(self.key(self.remembered), lambda: {"rows": rows, **_table(outcome)})
            self.remembered, self.new = self.remembered + 1, 0


def _evaluate(evaluation: Evaluation, X: Genes, of: tuple[object, ...]) -> Outcome:
    """Return the outcome of all rows, remembered in parts."""
    parts = _Parts(key=lambda i: key_of("rows", *of, X, i), size=len(X))
    parts.recall()
    where = _evaluate_in_workers if workers() and not evaluation.has_own_runner else _evaluate_here
    try:
        for rows, outcome in where(evaluation, X, parts.remaining):
            parts.add(rows, outcome)
            check_interruption()
    finally:
        parts.remember()
    return joined(parts.done)[1] if parts.done else evaluate_rows(evaluation.problem, evaluation.evaluate, X)


def _evaluate_here(evaluation: Evaluation, X: Genes, rows: Rows) -> Iterator[tuple[Rows, Outcome]]:
    """Yield rows with their outcome: all at once, but one by one, as many as may be done in their time."""
    size = 1 if evaluation.is_row_by_row else max(len(X), 1)
    while len(rows):
        begin, part = time.monotonic(), rows[:size]
        yield part, evaluate_rows(evaluation.problem, evaluation.evaluate, X[part])
        each = max(time.monotonic() - begin, 1e-9) / size
        rows, size = rows[size:], max(1, int(OPTIONS.seconds / each))


def _evaluate_in_workers(evaluation: Evaluation, X: Genes, rows: Rows) -> Iterator[tuple[Rows, Outcome]]:
    """Yield rows with their outcome, as workers return them; those that are lost, alone too, have failed."""
    size = evaluation.rows_of_a_task
    groups = [rows[first : first + size] for first in range(0, len(rows), size)]
    again = list[Rows]()
    results = distribute(_evaluate_group, evaluation, [X[group] for group in groups], seconds=evaluation.seconds)
    for place, values in results:
        if not isinstance(values, Lost):
            yield groups[place], _outcome(values)
        elif len(groups[place]) > 1:
            again += [groups[place][i : i + 1] for i in range(len(groups[place]))]
        else:
            yield groups[place], _failed(evaluation, values)
    for place, values in distribute(_evaluate_group, evaluation, [X[row] for row in again]):
        yield again[place], _failed(evaluation, values) if isinstance(values, Lost) else _outcome(values)


def _evaluate_group(evaluation: Evaluation, X: Genes) -> Values:
    """Return the outcome of rows as plain arrays, in a worker."""
    return _table(evaluate_rows(evaluation.problem, evaluation.evaluate, X))


def _check_rows_alone(evaluation: Evaluation, X: Genes) -> None:
    """Warn where a row's values depend, by rounding, on which rows are evaluated with it: then workers change them."""
    size = evaluation.rows_of_a_task
    if not workers() or evaluation.has_own_runner or size == 1 or len(X) <= size:
        return
    items = [X[:size], X[size : 2 * size], X[: 2 * size]]
    tables: dict[int, Any] = dict(distribute(_evaluate_group, evaluation, items))
    if any(isinstance(table, Lost) for table in tables.values()):
        return
    for name in ("F", "G", "H"):
        if not np.array_equal(np.concatenate([tables[i][name] for i in (0, 1)]), tables[2][name], equal_nan=True):
            text = (
                f"workers: wanted rows whose values do not depend on the rows beside them, got a problem whose {name} "
                "does; without workers the run comes to the same to rounding alone"
            )
            warn_user(text)
            return


def _failed(evaluation: Evaluation, lost: Lost) -> Outcome:
    outcome = Outcome.of(evaluation.problem, {}, 1)
    outcome.causes[0] = lost.cause
    return outcome


def _elementwise(problem: Any) -> bool:
    return bool(getattr(problem, "elementwise", False)) and hasattr(problem, "elementwise_runner")


def _table(outcome: Outcome) -> dict[str, np.ndarray]:
    """Return an outcome as plain arrays."""
    failed, causes = np.array(list(outcome.causes), dtype=np.int64), np.array(list(outcome.causes.values()), np.str_)
    return {"F": outcome.F, "G": outcome.G, "H": outcome.H, "failed": failed, "causes": causes}


def _outcome(values: Mapping[str, np.ndarray]) -> Outcome:
    """Return plain arrays as an outcome."""
    causes = dict(zip(values["failed"].tolist(), values["causes"].tolist(), strict=True))
    return Outcome(F=values["F"], G=values["G"], H=values["H"], causes=causes)

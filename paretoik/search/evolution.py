"""The loop of a search: ask, evaluate, tell, observe, until an ending is reached."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Int
from pymoo.core.problem import LoopedElementwiseEvaluation

from paretoik.arrays import Genes, Objectives
from paretoik.compilation_notices import computing_clock
from paretoik.errors import EvaluationFailed, InvalidInput, InvalidRun, warn_user
from paretoik.inputs import cause_of, limited_call, user_function, warn_of_odd_objectives
from paretoik.runs.distribution import Lost, distribute, workers
from paretoik.runs.journal import Values, key_of, recalled, remembered
from paretoik.search.ask_tell import Candidates, Search, outcome_of
from paretoik.search.endings import Ending, Progress
from paretoik.search.islands import Islands
from paretoik.search.objectives import Floats
from paretoik.stop_flag import check_interruption

# Evaluation of a batch of rows; if that fails, row by row.


Rows: TypeAlias = Int[np.ndarray, " _"]  # indices of rows
Evaluate: TypeAlias = Callable[[Genes], Mapping[str, Any]]


def evaluate_problem(problem: Any, X: Genes) -> Mapping[str, Any]:
    """Return the values of a pymoo problem. Raises InvalidInput for values that pymoo would misread.

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
    """A problem's ``_evaluate`` that checks the values before pymoo reads them."""

    problem: Any

    def __call__(self, x: Any, out: dict[str, Any], *arguments: Any, **named: Any) -> None:
        """Evaluate. Raises InvalidInput for values that are not real numbers."""
        type(self.problem)._evaluate(self.problem, x, out, *arguments, **named)
        for name in ("F", "G", "H"):
            for values in out[name] if isinstance(out.get(name), list | tuple) else [out.get(name)]:
                # masked, complex and textual values are refused; pymoo checks the shapes of the others
                wish = f"problem {type(self.problem).__name__}: {name} must be real numbers"
                try:
                    kind = np.asarray(values).dtype.kind
                except Exception as error:  # a foreign array may raise anything
                    raise InvalidInput(f"{wish}: {cause_of(error)}") from None
                if np.ma.is_masked(values) or kind not in "fiubO":
                    fact = "masked ones" if np.ma.is_masked(values) else "complex ones" if kind == "c" else "text"
                    raise InvalidInput(f"{wish}, got {fact}")


def evaluate_rows(problem: Any, evaluate: Evaluate, X: Genes) -> Values:
    """Return "F", "G", "H" and "cause" of a batch; if it raises, evaluate row by row."""
    try:
        ours = type(problem).__module__.startswith("paretoik.")  # our problems limit each user function
        with user_function("the problem"), nullcontext() if ours else limited_call("the problem"):
            return outcome_of(problem, evaluate(X.copy()), len(X))
    except EvaluationFailed as failure:
        if len(X) <= 1:
            return outcome_of(problem, {"cause": [str(failure)] * len(X)}, len(X))
    rows = [evaluate_rows(problem, evaluate, X[row : row + 1]) for row in range(len(X))]
    return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}


# Evaluation of a generation, from the run's journal, in this process or in workers. A part of a generation has its
# "rows" next to their outcome.


@dataclass(frozen=True, kw_only=True)
class EvaluationOptions:
    """Settings of evaluation.

    seconds: approximate time [s] between journal entries within a generation; the least is half of it
    rows: number of rows per task of a worker if a problem evaluates many at once; the same for any number of workers
    """

    seconds: float = 0.5
    rows: int = 8


OPTIONS = EvaluationOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Evaluation:
    """Evaluation of a problem's rows. ``seconds``: time limit per row in workers."""

    problem: Any
    evaluate: Evaluate
    seconds: float | None = None

    @property
    def runner(self) -> Any:
        """The runner of a problem that evaluates one row at a time; None if it evaluates many at once."""
        elementwise = getattr(self.problem, "elementwise", False)
        return getattr(self.problem, "elementwise_runner", None) if elementwise else None

    @property
    def is_row_by_row(self) -> bool:
        """Whether the problem itself evaluates one row after the other."""
        return isinstance(self.runner, LoopedElementwiseEvaluation)

    @property
    def uses_workers(self) -> bool:
        """Whether rows go to workers. They do not if the problem's own runner evaluates elsewhere."""
        return bool(workers()) and (self.runner is None or self.is_row_by_row)

    @property
    def rows_of_a_task(self) -> int:
        """Number of rows per task of a worker, which are timed together."""
        return 1 if self.is_row_by_row or self.seconds is not None else OPTIONS.rows

    def __call__(self, X: Genes) -> Values:
        """Return the outcome of rows. Workers call this too."""
        return evaluate_rows(self.problem, self.evaluate, X)


def evaluate_candidates(search: Search | Islands, candidates: Candidates, evaluation: Evaluation) -> Values:
    """Return the outcome of a generation, from the run's journal if it is there.

    Raises InvalidRun if the journal has the outcome of other genes: then the search is not reproducible. Raises
    Interrupted soon after a signal if rows are evaluated in workers or one by one; the journal then has the rows
    evaluated so far.
    """
    genes = np.frombuffer(key_of("genes", candidates.X), np.uint8)
    of = search.names, search.seed, candidates.generation

    def compute() -> Values:
        if candidates.generation == 0:
            _warn_of_dependent_rows(evaluation, candidates.X)
        return {**_evaluate(evaluation, candidates.X, of), "genes": genes}

    values = remembered(key_of("generation", *of), compute)
    if not np.array_equal(values["genes"], genes):
        raise InvalidRun(
            f"generation {candidates.generation + 1} must have the genes in the run's journal, got other genes: "
            "the problem, a library's version or the processor has changed"
        )
    return values


def evaluate_again(search: Search | Islands, candidates: Candidates, evaluation: Evaluation) -> Objectives:
    """Return F of a generation's first individual from a second evaluation, or from the run's journal."""
    of = search.names, search.seed, candidates.generation
    key = key_of("again", *of)
    return remembered(key, lambda: _evaluate(evaluation, candidates.X[:1], (*of, "again")))["F"]


def _evaluate(evaluation: Evaluation, X: Genes, of: tuple[object, ...]) -> Values:
    """Return the outcome of all rows.

    Parts that are in the journal are not evaluated again; new parts are written to it at intervals.
    """
    done, new, since = list[Values](), list[Values](), time.monotonic()
    while (values := recalled(key_of("rows", *of, X, len(done)))) is not None:
        done.append(values)

    def missing() -> Rows:
        return np.setdiff1d(np.arange(len(X)), np.concatenate([[], *(part["rows"] for part in (*done, *new))])).astype(
            int
        )

    def remember() -> None:
        """Write the new parts as one journal entry, unless no row is missing."""
        if new and len(missing()):
            part = _joined(new)
            remembered(key_of("rows", *of, X, len(done)), lambda: part)
            done.append(part)
            new.clear()

    where = _evaluate_in_workers if evaluation.uses_workers else _evaluate_here
    try:
        for part in where(evaluation, X, missing()):
            new.append(part)
            if time.monotonic() - since >= OPTIONS.seconds / 2:
                since = time.monotonic()
                remember()
            check_interruption()
    finally:
        remember()
    return _joined([*done, *new]) if done or new else evaluation(X)


def _joined(parts: Sequence[Values]) -> Values:
    """Return parts as one, in the order of their rows and without repeats."""
    order = np.unique(np.concatenate([part["rows"] for part in parts]), return_index=True)[1]
    return {name: np.concatenate([part[name] for part in parts])[order] for name in parts[0]}


def _evaluate_here(evaluation: Evaluation, X: Genes, rows: Rows) -> Iterator[Values]:
    """Yield the outcome of rows: all at once, or in groups that take limited time."""
    size = 1 if evaluation.is_row_by_row else max(len(X), 1)
    while len(rows):
        begin, part = time.monotonic(), rows[:size]
        yield {"rows": part, **evaluation(X[part])}
        each = max(time.monotonic() - begin, 1e-9) / size
        rows, size = rows[size:], max(1, int(OPTIONS.seconds / each))


def _evaluate_in_workers(evaluation: Evaluation, X: Genes, rows: Rows) -> Iterator[Values]:
    """Yield the outcome of rows as workers return them.

    Rows of a lost group are evaluated again one by one; a single row that is lost has failed.
    """
    size = evaluation.rows_of_a_task
    groups = [rows[first : first + size] for first in range(0, len(rows), size)]
    seconds = evaluation.seconds
    while groups:
        again = list[Rows]()
        for place, values in distribute(
            Evaluation.__call__, evaluation, [X[group] for group in groups], seconds=seconds
        ):
            group = groups[place]
            if not isinstance(values, Lost):
                yield {"rows": group, **values}
            elif len(group) > 1:
                again += np.split(group, len(group))
            else:
                yield {"rows": group, **outcome_of(evaluation.problem, {"cause": [values.cause]}, 1)}
        groups, seconds = again, None


def _warn_of_dependent_rows(evaluation: Evaluation, X: Genes) -> None:
    """Warn if an individual's values depend on the other individuals in its batch.

    Workers evaluate other batches, so that their values then differ by rounding.
    """
    size = evaluation.rows_of_a_task
    if not evaluation.uses_workers or size == 1 or len(X) <= size:
        return
    items = [X[:size], X[size : 2 * size], X[: 2 * size]]
    tables: dict[int, Any] = dict(distribute(Evaluation.__call__, evaluation, items))
    if any(isinstance(table, Lost) for table in tables.values()):
        return
    for name in ("F", "G", "H"):
        apart, together = np.concatenate([tables[0][name], tables[1][name]]), tables[2][name]
        if not np.array_equal(apart, together, equal_nan=True):
            text = f"{name} of a row must be the same in every batch, got different values"
            warn_user(f"{text}; results with workers differ from those without")
            return


# The loop of a search.


def evolve(
    search: Search | Islands,
    endings: Sequence[Ending],
    *,
    evaluate: Evaluate | None = None,
    seconds: float | None = None,
    observe: Callable[[Progress], object] | None = None,
    improve: Callable[[Progress], Genes | None] | None = None,
) -> str:
    """Run a search until one of ``endings`` is reached, and return its reason.

    The result is in ``search``. Ctrl-C ends a search with "interrupted".

    evaluate: function of X that returns a mapping with "F", constraints "G" and "H", and optionally "cause", a reason
        of failure per row; by default the problem's own. If it raises, rows are tried one by one, and those that raise
        again count as failed.
    seconds: time limit of a row in workers
    observe: called with the progress after each generation
    improve: called with the progress; may return genes for the next generation

    Raises InvalidInput if there is no ending, EvaluationFailed if every evaluation of the first generation failed.
    """
    if not endings:
        raise InvalidInput("endings must have at least one ending, got none")
    evaluate = partial(evaluate_problem, search.problem) if evaluate is None else evaluate
    evaluation = Evaluation(problem=search.problem, evaluate=evaluate, seconds=seconds)
    memory = max(ending.memory for ending in endings)
    past: tuple[Floats, ...] = ()
    started = computing_clock()
    try:
        while True:
            candidates = search.ask()
            ids = candidates.ids
            outcome = evaluate_candidates(search, candidates, evaluation)
            causes = {
                number: cause for number, cause in zip(ids.tolist(), outcome["cause"].tolist(), strict=True) if cause
            }
            search.tell(ids, outcome["F"], outcome["G"], H=outcome["H"], causes=causes)
            if candidates.generation == 0 and search.failed.count == len(ids):
                raise EvaluationFailed(
                    f"first generation must have a successful evaluation, got {len(ids)} failed evaluations, "
                    f"the first with: {search.failed.first_cause}"
                )
            if candidates.generation == 0:
                again, signs = evaluate_again(search, candidates, evaluation), np.where(search.maximised, -1.0, 1.0)
                warn_of_odd_objectives(search.names, outcome["F"] * signs, again * signs)
            progress = progress_of(search, past, computing_clock() - started)
            if observe is not None:
                observe(progress)
            for ending in endings:
                reason = ending.reached(progress)
                if reason is not None:
                    return reason
            if improve is not None and (suggested := improve(progress)) is not None:
                search.suggest(suggested)
            past = (*past, progress.front)[-memory:] if memory else ()
    except KeyboardInterrupt:
        return "interrupted"


def progress_of(search: Search | Islands, past: tuple[Floats, ...], seconds: float) -> Progress:
    """Return the progress of a search after ``seconds``, with the ``past`` fronts."""
    return Progress(
        generation=search.generation,
        evaluations=search.evaluations,
        seconds=seconds,
        failed=search.failed,
        population=search.population,
        front=search.archive.F,
        ids=search.archive.ids,
        past=past,
    )

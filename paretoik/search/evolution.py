"""The loop that drives a search: ask, evaluate, tell, observe, until an ending is reached."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from paretoik.arrays import Genes
from paretoik.errors import EvaluationFailed, InvalidInput, InvalidRun
from paretoik.journal import key_of, remembered
from paretoik.search.ask_tell import Candidates, Outcome, Search
from paretoik.search.constraints import Floats
from paretoik.search.endings import Ending, Progress

Evaluate: TypeAlias = Callable[[Genes], Mapping[str, Any]]


def evolve(
    search: Search,
    endings: Sequence[Ending],
    *,
    evaluate: Evaluate | None = None,
    observe: Callable[[Progress], object] | None = None,
    improve: Callable[[Progress], Genes | None] | None = None,
) -> str:
    """Run a search until the first of ``endings`` is reached and return its reason; the result stays in ``search``.

    ``evaluate(X)`` returns a mapping with "F", with constraints "G" and "H", and if it likes "cause", a text a row that
    says why it failed; by default it is the problem's own. When it raises, its rows are tried one by one, and those
    that raise again count as failed. After each generation ``observe`` is shown the progress, and ``improve`` may
    return genes to be evaluated in the next. Ctrl-C ends with "interrupted".

    Raises InvalidInput for no ending, EvaluationFailed where every evaluation of the first generation failed.
    """
    if not endings:
        raise InvalidInput("endings: at least one wanted, got none")
    if evaluate is None:
        evaluate = partial(search.problem.evaluate, return_as_dictionary=True)
    memory = max(ending.memory for ending in endings)
    past: tuple[Floats, ...] = ()
    started = time.monotonic()
    try:
        while True:
            _one_generation(search, evaluate)
            progress = _progress(search, past, time.monotonic() - started)
            if observe is not None:
                observe(progress)
            for ending in endings:
                reason = ending.reached(progress)
                if reason is not None:
                    return reason
            suggested = None if improve is None else improve(progress)
            if suggested is not None:
                search.suggest(suggested)
            past = (*past, progress.front)[-memory:] if memory else ()
    except KeyboardInterrupt:
        return "interrupted"


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


def _one_generation(search: Search, evaluate: Evaluate) -> None:
    candidates = search.ask()
    ids = candidates.ids
    outcome = _remembered_outcome(search, candidates, evaluate)
    causes = {int(ids[row]): cause for row, cause in outcome.causes.items()}
    search.tell(ids, outcome.F, outcome.G, H=outcome.H, causes=causes)
    if candidates.generation == 0 and search.failed.count == len(ids):
        raise EvaluationFailed(
            f"first generation: a number from at least one evaluation wanted, all {len(ids)} failed, "
            f"the first with: {search.failed.first_cause}"
        )


def _remembered_outcome(search: Search, candidates: Candidates, evaluate: Evaluate) -> Outcome:
    """Return the outcome of a generation, from the run's journal where it is there.

    Raises InvalidRun where the journal has that of other genes: then the search does not repeat itself.
    """

    def compute() -> dict[str, np.ndarray]:
        outcome = evaluate_rows(search.problem, evaluate, candidates.X)
        rows, causes = list(outcome.causes), list(outcome.causes.values())
        texts = {"failed": np.array(rows, dtype=np.int64), "causes": np.array(causes, dtype=np.str_)}
        return {"asked": asked, "F": outcome.F, "G": outcome.G, "H": outcome.H, **texts}

    asked = np.frombuffer(key_of("genes", candidates.X), np.uint8)
    values = remembered(key_of("generation", search.names, search.seed, candidates.generation), compute)
    if not np.array_equal(values["asked"], asked):
        raise InvalidRun(
            f"generation {candidates.generation + 1}: wanted the genes that the journal of the run has, got others: "
            "the problem, a library's version or the processor is another"
        )
    causes = dict(zip(values["failed"].tolist(), values["causes"].tolist(), strict=True))
    return Outcome(F=values["F"], G=values["G"], H=values["H"], causes=causes)


def _progress(search: Search, past: tuple[Floats, ...], seconds: float) -> Progress:
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

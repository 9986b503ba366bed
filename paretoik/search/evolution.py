"""The loop that drives a search: ask, evaluate, tell, observe, until an ending is reached."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from paretoik.arrays import Genes
from paretoik.compilation_notices import computing_clock
from paretoik.errors import EvaluationFailed, InvalidInput
from paretoik.search.ask_tell import Search
from paretoik.search.constraints import Floats
from paretoik.search.endings import Ending, Progress
from paretoik.search.evaluation import Evaluate, evaluate_problem
from paretoik.search.generation_evaluation import Evaluation, evaluate_again, evaluate_candidates
from paretoik.search.islands import Islands
from paretoik.user_functions import warn_of_odd_objectives


def evolve(
    search: Search | Islands,
    endings: Sequence[Ending],
    *,
    evaluate: Evaluate | None = None,
    seconds: float | None = None,
    observe: Callable[[Progress], object] | None = None,
    improve: Callable[[Progress], Genes | None] | None = None,
) -> str:
    """Run a search until the first of ``endings`` is reached and return its reason; the result stays in ``search``.

    ``evaluate(X)`` returns a mapping with "F", with constraints "G" and "H", and if it likes "cause", a text a row that
    says why it failed; by default it is the problem's own. When it raises, its rows are tried one by one, and those
    that raise again count as failed. Workers, where there are any, give up a row after so many ``seconds``. After each
    generation ``observe`` is shown the progress, and ``improve`` may return genes to be evaluated in the next. Ctrl-C
    ends with "interrupted".

    Raises InvalidInput for no ending, EvaluationFailed where every evaluation of the first generation failed.
    """
    if not endings:
        raise InvalidInput("endings: at least one wanted, got none")
    if evaluate is None:
        evaluate = partial(evaluate_problem, search.problem)
    evaluation = Evaluation(problem=search.problem, evaluate=evaluate, seconds=seconds)
    memory = max(ending.memory for ending in endings)
    past: tuple[Floats, ...] = ()
    started = computing_clock()
    try:
        while True:
            _one_generation(search, evaluation)
            progress = _progress(search, past, computing_clock() - started)
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


def _one_generation(search: Search | Islands, evaluation: Evaluation) -> None:
    candidates = search.ask()
    ids = candidates.ids
    outcome = evaluate_candidates(search, candidates, evaluation)
    causes = {int(ids[row]): cause for row, cause in outcome.causes.items()}
    search.tell(ids, outcome.F, outcome.G, H=outcome.H, causes=causes)
    if candidates.generation == 0 and search.failed.count == len(ids):
        raise EvaluationFailed(
            f"first generation: a number from at least one evaluation wanted, all {len(ids)} failed, "
            f"the first with: {search.failed.first_cause}"
        )
    if candidates.generation == 0:
        again, signs = evaluate_again(search, candidates, evaluation), np.where(search.maximised, -1.0, 1.0)
        warn_of_odd_objectives(search.names, outcome.F * signs, again * signs)


def _progress(search: Search | Islands, past: tuple[Floats, ...], seconds: float) -> Progress:
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

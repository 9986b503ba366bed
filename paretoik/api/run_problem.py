"""The problem of a stored run: the one that the user names, never the one that the run names.

A run folder may come from anybody, and loading a problem runs its file. So a problem is loaded only from what the user
gives: ``problem=`` in Python, ``--problem FILE.py:NAME`` or a yes to the question on the command line.
"""

from __future__ import annotations

from typing import Any

from paretoik.errors import EvaluationFailed, InvalidInput, SolverFailed
from paretoik.execution.time_limit import TimeLimit, check_time_limit, limited_evaluations
from paretoik.formulations.protocol import timeline
from paretoik.inputs import shown
from paretoik.loading import load_problem
from paretoik.run_files import problem_words
from paretoik.shell_command import shell_command
from paretoik.stop_flag import Interrupted
from paretoik.user_functions import CALLS


def named_problem(problem: Any, *, time_limit: float | None = None, evaluation_timeout: float | None = None) -> Any:
    """Return ``problem``, or the one that it names if it is text.

    Loading one takes at most ``time_limit`` [s], and each call of a user's function ``evaluation_timeout`` [s]. Raises
    as ``load_problem``; SolverFailed if the problem is not there in time; EvaluationFailed if several calls are ended.
    """
    if not isinstance(problem, str):
        return problem
    check_time_limit(time_limit)
    limit = TimeLimit(seconds=time_limit)
    try:
        with limit.limiting_calls(), limited_evaluations(evaluation_timeout, allowed=CALLS.allowed):
            return load_problem(problem)
    except Interrupted as stop:
        if not stop.reason:
            raise
        if not limit.reached:
            raise EvaluationFailed(f"no problem was built: {stop.reason}, {CALLS.allowed + 1} times") from None
        raise SolverFailed(f"time_limit: no problem was built within {time_limit:g} s; {stop.reason}") from None


def how_to_name(reference: object) -> str:
    """Return how the problem of a run that names a ``reference`` is given."""
    words = problem_words(reference)
    if not words:
        return "the run names none; problem=, or --problem FILE.py:NAME, gives it"
    return f"its file is run only if you name it: problem=, or {shell_command(*words)}"


def check_problem_argument(problem: object) -> None:
    """Raise InvalidInput unless this is a problem, the name of one, or None; of a polygon it is the arm."""
    timeline(problem)
    is_problem = not isinstance(problem, type) and (hasattr(problem, "n_obj") or hasattr(problem, "dof"))
    if problem is not None and not isinstance(problem, str) and not is_problem:
        raise InvalidInput(f"problem: a problem or FILE.py:NAME wanted, got {shown(problem)}")

"""The problem of a stored run: the one that the user names, never the one that the run names.

A run folder may come from anybody, and loading a problem runs its file. So a problem is loaded only from what the user
gives: ``problem=`` in Python, ``--problem FILE.py:NAME`` or a yes to the question on the command line.
"""

from __future__ import annotations

from typing import Any

from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import timeline
from paretoik.inputs import shown
from paretoik.loading import load_problem
from paretoik.run_files import problem_words
from paretoik.shell_command import shell_command


def named_problem(problem: Any) -> Any:
    """Return ``problem``, or the one that it names if it is text; raises as ``load_problem``."""
    return load_problem(problem) if isinstance(problem, str) else problem


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

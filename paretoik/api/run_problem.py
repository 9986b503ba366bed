"""The problem of a stored run: the one that a user names, or the one that the run names, inside the current project.

A run folder may come from anybody, and loading a problem runs its file. What a run names is therefore loaded unasked
only where it is a file below the current folder that did not come with the run: ``check_own``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from paretoik.errors import InvalidInput
from paretoik.loading import load_problem

CONFIRM = "name the problem to have it: load_front(folder, problem), or --problem FILE.py:NAME"


def problem_of_run(folder: Path, reference: object, problem: Any = None) -> Any:
    """Return ``problem``, or what it names if it is text, or else what a run names; None where that is nothing.

    Raises InvalidInput where the run names what is not the user's own, and as ``load_problem`` does.
    """
    if isinstance(problem, str):
        return load_problem(problem)
    if problem is not None or reference is None:
        return problem
    check_own(folder, reference)
    return load_problem(str(reference))


def check_own(folder: Path, reference: object) -> None:
    """Raise InvalidInput where what a run in a folder names is not a file of the current project.

    Such a file lies below the current folder, links followed, outside the run, and in no folder below it that the run
    is in too: they may have come together. The home folder and those above it are no projects; modules, which may be
    anywhere on Python's path, are not loaded for a run.
    """
    place, _, name = str(reference).rpartition(":")
    file, run, project = Path(place), folder.resolve(), Path.cwd().resolve()
    if file.suffix != ".py" or not name:
        raise InvalidInput(f"the run names {reference!r}, which is no FILE.py:NAME; {CONFIRM}")
    if not file.is_file():
        raise InvalidInput(f"problem file {place}: the run names it, and there is none in {project}; {CONFIRM}")
    file = file.resolve()
    if not file.is_relative_to(project) or project in (Path.home(), *Path.home().parents):
        raise InvalidInput(f"problem file {place}: the run names it, and it is not below {project}; {CONFIRM}")
    parts, shared = file.relative_to(project).parts, project
    if len(parts) > 1:
        shared = project / parts[0]
    if file.is_relative_to(run) or (shared != project and run.is_relative_to(shared)):
        raise InvalidInput(f"problem file {place}: the run names it, and it lies beside the run; {CONFIRM}")

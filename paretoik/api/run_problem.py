"""The problem of a stored run: the one that a user names, or the one that the run names, inside the current project.

A run folder may come from anybody, and loading a problem runs its file. What a run names is therefore loaded unasked
only where it is a file below the current folder that did not come with the run: ``check_own``.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from paretoik.errors import InvalidInput
from paretoik.inputs import shown
from paretoik.loading import load_problem
from paretoik.missing_files import missing_file
from paretoik.run_files import RUN

CONFIRM = "problem=, or --problem FILE.py:NAME, loads one wherever it is"
LONGEST = 200  # characters that messages quote


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


def check_problem_argument(problem: object) -> None:
    """Raise InvalidInput unless this is a problem, the name of one, or None; of a polygon it is the arm."""
    is_problem = not isinstance(problem, type) and (hasattr(problem, "n_obj") or hasattr(problem, "dof"))
    if problem is not None and not isinstance(problem, str) and not is_problem:
        raise InvalidInput(f"problem: a problem or FILE.py:NAME wanted, got {shown(problem)}")


def check_own(folder: Path, reference: object) -> None:
    """Raise InvalidInput where what a run in a folder names is not a file of the current project.

    Such a file lies below the current folder, links followed, in no folder of any run, and in no folder below the
    current one that the run is in too: they may have come together. Whoever goes into a folder makes it the current
    project: open a stranger's folder from outside it. The home folder and those above it are no projects, nor is what
    lies in a run; modules, which may be anywhere on Python's path, are not loaded for a run.
    """
    text, project = str(reference), Path.cwd().resolve()
    try:
        fault = _fault(text, folder.resolve(), project)
    except OSError as error:  # a name that is too long, a folder that nobody may look into
        fault = f"no file that can be looked at, {error.strerror}"
    if fault:
        raise InvalidInput(f"{folder}: wanted a problem of this project, got {text[:LONGEST]!r}, {fault}; {CONFIRM}")


def _fault(reference: str, run: Path, project: Path) -> str:
    """Return why what a run names is not loaded unasked, "" where it may be."""
    place, _, name = reference.rpartition(":")
    if not name or Path(place).suffix != ".py" or "\0" in place:
        return "no FILE.py:NAME"
    if not Path(place).is_file():
        return missing_file(Path(place))
    file = Path(place).resolve()
    if not _is_project(project) or not file.is_relative_to(project):
        return f"a file that is not below a project's folder: this is {project}"
    parent = project / file.relative_to(project).parts[0]
    if file.is_relative_to(run) or (parent.is_dir() and run.is_relative_to(parent)):
        return "a file that lies beside the run"
    within = next((each for each in file.parents if os.path.lexists(each / RUN)), None)
    if within is not None:
        return f"a file in a run's folder, {within}"
    return ""


def _is_project(folder: Path) -> bool:
    """Return whether a folder may be a project's: one that is neither the home folder nor above it."""
    try:
        home = Path.home().resolve()
    except RuntimeError:  # this user has none
        return True
    return folder != home and folder not in home.parents

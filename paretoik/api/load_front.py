"""Open the front of a run again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from paretoik.api.run_problem import check_problem_argument, problem_of_run
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidRun, ParetoikError
from paretoik.fingerprint.fingerprint import check_fingerprint
from paretoik.formulations.stored_motions import restore_motions
from paretoik.front.front import Front
from paretoik.front.subset import attach
from paretoik.inputs import file_path
from paretoik.run_files import MOTIONS
from paretoik.user_warnings import warn_user


@check_call
def load_front(folder: str | Path, problem: Any = None) -> Front:
    """Return the front of a run folder; its motions are whole where its problem is at hand.

    That is ``problem``, which may also be its name, "FILE.py:NAME". Without one it is the problem that the run names,
    where its file lies below the current folder and not beside the run: what a run names is not run for others. Where
    it cannot be had, motions have joint positions alone, with a warning.

    Raises
    ------
    InvalidRun
        Where the folder is no run, or damaged, or its motions are not on the path of the problem.
    InvalidInput
        Where ``problem`` is not the one that the run solved, or cannot be loaded.
    """
    folder = file_path("folder", folder)
    check_problem_argument(problem)
    return with_problem(Front.load(folder), folder, problem)


def with_problem(front: Front, folder: Path, problem: Any) -> Front:
    """Return a front that was read from a folder with its problem, as ``load_front`` does, and raise what that does."""
    try:
        whole = problem_of_run(folder, front.provenance.get("problem"), problem)
        if whole is None:
            return front
        wish = f"{folder}: wants the problem that the run solved"
        check_fingerprint(whole, front.provenance.get("fingerprint"), wish=wish)
    except ParetoikError as error:
        if problem is not None:
            raise
        cause = str(error).removeprefix(f"{folder}: ")
        warn_user(f"{folder}: motions come without their arm: {cause}")
        return front
    try:
        motions = restore_motions(whole, front)
    except InvalidRun as fault:
        raise InvalidRun(f"{folder / MOTIONS}: {fault}") from None
    return attach(replace(front, motions=motions, problem=whole), folder)

"""Open the front of a run again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from paretoik.api.run_problem import check_problem_argument, how_to_name, named_problem
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidRun
from paretoik.fingerprint.fingerprint import check_fingerprint
from paretoik.formulations.protocol import at_samples_of
from paretoik.formulations.stored_motions import restore_motions
from paretoik.front.front import Front
from paretoik.front.subset import attach
from paretoik.inputs import file_path
from paretoik.run_files import MOTIONS
from paretoik.user_warnings import warn_user


@check_call
def load_front(folder: str | Path, problem: Any = None) -> Front:
    """Return the front of a run folder; its motions have their arm if its problem is given.

    ``problem`` is the problem or its name, "FILE.py:NAME", whose file is run. What a run folder names is never run: the
    folder may come from anybody. Without ``problem`` motions have joint positions only, with a warning.

    Raises
    ------
    InvalidRun
        If the folder is no run, or damaged, or its motions are not on the path of the problem.
    InvalidInput
        If ``problem`` is not the one that the run solved, or cannot be loaded.
    """
    folder = file_path("folder", folder)
    check_problem_argument(problem)
    return with_problem(Front.load(folder), folder, problem)


def with_problem(front: Front, folder: Path, problem: Any) -> Front:
    """Return a front that was read from a folder with its problem, as ``load_front`` does, and raise what that does."""
    whole, reference = named_problem(problem), front.provenance.get("problem")
    if whole is None:
        if reference is not None:
            text = "motions come without their arm, as the problem is not at hand"
            warn_user(f"{folder}: {text}: {how_to_name(reference)}")
        return front
    wish = f"{folder}: wants the problem that the run solved"
    check_fingerprint(whole, front.provenance.get("fingerprint"), wish=wish)
    whole = at_samples_of(whole, getattr(front.motions, "q", None))
    try:
        motions = restore_motions(whole, front)
    except InvalidRun as fault:
        raise InvalidRun(f"{folder / MOTIONS}: {fault}") from None
    return attach(replace(front, motions=motions, problem=whole), folder)

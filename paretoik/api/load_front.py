"""Open the front of a run again."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

from paretoik.errors import InvalidInput, ParetoikError
from paretoik.formulations.protocol import restore_motions
from paretoik.front.front import Front
from paretoik.front.subset import attach
from paretoik.inputs import file_path
from paretoik.loading import fingerprint, load_problem


def load_front(folder: str | Path, problem: Any = None) -> Front:
    """Return the front of a run folder; its motions are whole where ``problem``, or the one the run names, can be had.

    Raises
    ------
    InvalidRun
        Where the folder is no run, or damaged.
    InvalidInput
        Where ``problem`` is not the one that the run solved.
    """
    folder = file_path("folder", folder)
    front = Front.load(folder)
    reference = front.provenance.get("problem")
    if problem is None and reference is not None:
        try:
            problem = load_problem(str(reference))
        except ParetoikError as error:
            warnings.warn(f"{folder}: motions come without their arm: {error}", RuntimeWarning, stacklevel=2)
    if problem is None:
        return front
    if fingerprint(problem) != front.provenance.get("fingerprint"):
        raise InvalidInput(f"{folder}: wants the problem that the run solved, but its fingerprint is another")
    return attach(replace(front, motions=restore_motions(problem, front), problem=problem), front.folder)

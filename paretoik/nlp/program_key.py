"""What a run's journal knows the results of a program at a point by."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from paretoik.arrays import Point
from paretoik.errors import EvaluationFailed
from paretoik.journal import is_journalled, key_of
from paretoik.nlp.program import Program


def program_key(kind: str, program: Program, x: Point, *inputs: object) -> bytes | None:
    """Return the key of what is made of a program at a point and of inputs; None where there is no journal.

    The program is known by its names and its values at the point: other limits have other inequalities there.
    """
    if not is_journalled():
        return None
    values: tuple[np.ndarray, ...] = ()
    with suppress(EvaluationFailed):  # where what is made of it fails, too
        values = program.evaluate(x)
    names = program.objective_names, program.inequality_names, program.kinked
    return key_of(kind, *names, program.upper, *values, x, *inputs)

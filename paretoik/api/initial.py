"""Genes to start from: a user's own, those of motions, or those of a former front."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from paretoik.arrays import Genes
from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import encode
from paretoik.front.front import Front
from paretoik.loading import fingerprint
from paretoik.task.motion import Motion


def initial_genes(problem: Any, initial: Genes | Motion | Front | None, *, tolerance: float = 1e-6) -> Genes | None:
    """Return genes (rows, n_var) of solutions to start from; warn of motions that they miss by more [rad, m].

    Raises InvalidInput for a front of another problem without motions, and for motions that it cannot encode.
    """
    if isinstance(initial, Front):
        if initial.genes is not None and initial.provenance.get("fingerprint") == fingerprint(problem):
            return np.array(initial.genes)
        if initial.motions is None:
            raise InvalidInput("initial: the front is of another problem and has no motions to start from")
        initial = initial.motions  # type: ignore[assignment]  # a front of motions holds Motion
    if initial is None or isinstance(initial, np.ndarray | list):
        return initial
    if not hasattr(initial, "q"):
        raise InvalidInput(f"initial: genes, motions or a front wanted, got {type(initial).__name__}")
    genes, deviation = encode(problem, initial)
    inexact = deviation > tolerance
    if inexact.any():
        warnings.warn(
            f"initial: {inexact.sum()} of {len(genes)} motions start approximately; the genes miss them by up to "
            f"{deviation.max():.2g} rad (or m)",
            RuntimeWarning,
            stacklevel=4,
        )
    return genes

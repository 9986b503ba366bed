"""What lies between neighbours of a certified front of two objectives: jumps, and hypervolume still to be gained."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

from paretoik.front.tangents import curve_area, tangents_meet

if TYPE_CHECKING:  # a front asks this file for its gaps
    from paretoik.front.front import Front


@dataclass(frozen=True, kw_only=True)
class JumpOptions:
    """Between two neighbours so many ``places`` are looked at, evenly spaced.

    A barrier is higher than ``height``, a share of the front's extent: less is what solvers leave open.
    """

    places: int = 7
    height: float = 1e-6


OPTIONS = JumpOptions()


def find_jumps(front: Front) -> tuple[tuple[int, int], ...] | None:
    """Return the neighbours, as pairs of ids, with a barrier between them; None where that is not known.

    On one branch the optimum moves continuously from one neighbour to the other, and what lies halfway is, to first
    order, a trade-off between the two: no worse than the worse of them in either objective. Between two branches, or
    valleys, it is. Tangents cannot tell a jump: where branches cross they agree with a front that bulges out, and at an
    inflection of one branch they contradict each other.
    """
    between = getattr(front.problem, "values_between", None)
    if not _has_order(front) or between is None:
        return None
    if len(front) < 2:
        return ()
    values, inner = front.minimised, between(front, np.arange(1, OPTIONS.places + 1) / (OPTIONS.places + 1))
    corners = np.maximum(values[:-1], values[1:]) + OPTIONS.height * np.ptp(values, axis=0)
    barrier = (inner > corners[:, None]).any(axis=(1, 2))
    return tuple((int(front.ids[i]), int(front.ids[i + 1])) for i in np.flatnonzero(barrier))


def missing_hypervolume(front: Front) -> float | None:
    """Return the estimated share of the hypervolume that the points miss; None where it is not defined."""
    if not _has_order(front) or len(front) < 2:
        return None
    rows = _order(front)
    values, normals = front.minimised[rows], _normals(front)[rows]
    pairs = [[i, j] for i, j in pairwise(range(len(rows))) if (values[i] != values[j]).all()]
    missing = sum(curve_area(values[pair], tangents_meet(*values[pair], *normals[pair])) for pair in pairs)
    steps = (values[-1, 0] - values[1:, 0]) * (values[:-1, 1] - values[1:, 1])
    whole = float(steps.sum()) + missing
    return missing / whole if whole > 0 else 0.0


def _has_order(front: Front) -> bool:
    return len(front.names) == 2 and front.certificates is not None


def _order(front: Front) -> Int[np.ndarray, " points"]:
    """Return the rows by the first objective, the best first."""
    return np.argsort(front.minimised[:, 0], kind="stable")


def _normals(front: Front) -> Float[np.ndarray, "points 2"]:
    """Return the weights of the minimised objectives, in natural units, that the exchange rates are those of.

    Where one objective has no weight it is the other's alone; NaN where there is no reliable rate.
    """
    assert front.certificates is not None
    sign = np.prod(np.where(front.maximised, -1.0, 1.0))
    rates = sign * front.certificates.exchange_rates[:, 0, 1]
    normals = np.stack([-rates, np.ones(len(front))], axis=1)
    return np.where(front.certificates.weak[:, None], np.round(front.certificates.weights), normals)

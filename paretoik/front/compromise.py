"""The compromise: what the word means wherever this project says it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from paretoik.arrays import Objectives, Values
from paretoik.call_arguments import check_call
from paretoik.front.preference_options import OPTIONS
from paretoik.front.reason import percent, subject
from paretoik.front.subset import check_front, check_has_points
from paretoik.front.ties import first_row
from paretoik.tables import html_representation

if TYPE_CHECKING:
    from paretoik.front.front import Choice, Front

COMPROMISE_IN_WORDS = "the point whose hardest-hit objective gives up the least, as a share of its range on the front"


@check_call
@dataclass(frozen=True, kw_only=True)
class Compromise:
    """The compromise: the point whose hardest-hit objective gives up the least, as a share of its range.

    It has the least max Z + 1e-4 ΣZ, Z = (f − ideal)/(nadir − ideal) on the stored ranges: compromise programming with
    the Chebyshev distance (Yu 1973; Zeleny 1973). Unlike the point of equal weights it exists on hollow fronts too,
    where weights reach ends alone, and naming an objective twice does not move it (its augmentation aside). Of one
    objective it is the best point.
    """

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the compromise of a front that has at least one point."""
        check_front(front)
        scores = score_shares(front.shares)
        row = first_row(front, scores)
        worst = int(front.shares[row].argmax())
        given_up = f", {COMPROMISE_IN_WORDS}: {percent(front.shares[row, worst])}, of {front.names[worst]}"
        return front.choice(
            row,
            f"{subject(front, row)} is the compromise{given_up if len(front) > 1 else ''}.",
            preference=self,
            score=float(scores[row]),
        )


def score_shares(shares: Objectives) -> Values:
    """Return what the compromise has least, of points by their shares of the ranges (points, n_obj)."""
    columns = np.ascontiguousarray(shares.T)  # reducing rows of a few numbers takes NumPy ten times as long
    scores: Values = columns.max(axis=0) + OPTIONS.augmentation * columns.sum(axis=0)
    return scores


def compromise(front: Front) -> Choice:
    """Return the compromise of a front (``Compromise``), which is kept nowhere.

    Raises Infeasible where the front is empty.
    """
    check_has_points(front, "compromise")
    return Compromise().choose(front)

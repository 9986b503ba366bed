"""What a search asks for, what was evaluated, and the front that its archive holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from paretoik.arrays import Genes, Ids, Objectives
from paretoik.inputs import check_count
from paretoik.search.archive import Archive
from paretoik.search.constraints import Floats, column_tolerance
from paretoik.search.maximin import survivors
from paretoik.tables import field_representation, html_representation

if TYPE_CHECKING:
    from paretoik.front import Front


@dataclass(frozen=True, eq=False)
class Candidates:
    """What to evaluate: ``ids`` (n,), genes ``X`` (n, genes), and the index of their ``generation``, from 0."""

    ids: Ids
    X: Genes
    generation: int

    __repr__ = field_representation
    _repr_html_ = html_representation


@dataclass(frozen=True, eq=False)
class Outcome:
    """Evaluated rows: ``F``, ``G``, ``H`` (rows, columns), and ``causes`` of failure by row or id."""

    F: Objectives
    G: Floats
    H: Floats
    causes: dict[int, str]

    @classmethod
    def of(cls, problem: Any, results: Mapping[str, Any], rows: int) -> Outcome:
        """Return results "F", "G", "H" and "cause" of so many rows, NaN where there are none."""
        columns = {"F": problem.n_obj, "G": problem.n_ieq_constr, "H": problem.n_eq_constr}
        tables = {k: np.asarray(results.get(k, np.full((rows, size), np.nan))) for k, size in columns.items()}
        causes = {row: str(cause) for row, cause in enumerate(results.get("cause", ())) if cause}
        return cls(**tables, causes=causes)


@dataclass(frozen=True, kw_only=True, eq=False)
class Feasibility:
    """By how much a constraint G ≤ 0, and H = 0, may be missed: one number, or one each."""

    tolerance: ArrayLike
    equality_tolerance: ArrayLike

    def archive(self, problem: Any, names: Sequence[str]) -> Archive:
        """Return an archive without points for a problem, whose objectives have ``names``."""
        inequalities = column_tolerance("tolerance", self.tolerance, problem.n_ieq_constr)
        tolerance = np.concatenate((inequalities, np.zeros(problem.n_eq_constr)))
        return Archive(tolerance=tolerance, names=names)

    def columns(self, outcome: Outcome) -> Floats:
        """Return constraints as an archive has them: one table, those of H less what they may be missed by."""
        slack = column_tolerance("equality_tolerance", self.equality_tolerance, outcome.H.shape[1])
        return np.column_stack((outcome.G, np.abs(outcome.H) - slack))


def archive_front(search: Any, points: int | None) -> Front:
    """Return the front of a search's archive, thinned by MaxiMin to at most so many points; None keeps all of them."""
    from paretoik.front import Front  # here: it takes time

    check_count("points", points)
    members, problem = search.archive.members, search.problem
    if members is not None and points is not None and len(members) > points:
        members = members[np.sort(survivors(members.F, np.zeros(len(members)), points).index)]
    X = np.empty((0, problem.n_var)) if members is None else members.X
    F = np.empty((0, problem.n_obj)) if members is None else members.F
    decode = getattr(problem, "decode", None)
    return Front(
        ids=np.empty(0, dtype=np.int64) if members is None else members.ids,
        objectives=np.where(search.maximised, -F, F),
        names=search.names,
        units=search.units,
        maximised=search.maximised,
        genes=X,
        motions=decode(X) if decode is not None and len(X) else None,
        violation=None if members is None else members.G.max(axis=1, initial=0.0),
    )

"""Refine a front over its own ranges and add further points."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.arrays import Ids, Point, Points, Values
from paretoik.compilation_notices import computing_clock
from paretoik.errors import Infeasible, SolverFailed
from paretoik.front.front import Front
from paretoik.front.hypervolume import non_dominated, ranges_of
from paretoik.nlp.program import FEASIBLE
from paretoik.pareto.certified_front import Certifier, certified_front, no_worse
from paretoik.pareto.differentiable import Differentiable
from paretoik.pareto.epsilon import epsilon_points
from paretoik.pareto.placement import POINT_TOLERANCE, front_rows
from paretoik.pareto.refine import refine
from paretoik.pareto.scalarisation import evaluate_points
from paretoik.pareto.sweep import SweepProgress
from paretoik.progress import count_observer, is_due
from paretoik.stop_flag import STOP, Interrupted, check_interruption


@dataclass(frozen=True, kw_only=True)
class RefinementOptions:
    """Settings of repeated refinement.

    Criticality is in shares of the ranges: with the wide ranges of a coarse search it is almost 0 even at points that
    are not critical with the ranges of the final front.
    """

    rounds: int = 3  # largest number of rounds
    shrinkage: float = 0.5  # ratio of a range to its former size, below which another round follows
    smallest_share: float = 1e-3  # lower limit of the ratio; smaller ranges are near the solvers' tolerances


OPTIONS = RefinementOptions()


@dataclass(frozen=True, kw_only=True)
class Completion:
    """Settings of points added to a front: optima, and points in gaps."""

    points: int  # largest number of points of the completed front
    seed: int  # seed of random starts
    first_id: int  # id of the first new point
    # number of starts per objective; fewer than without a search, because the search has explored already
    starts: int = 24
    cold_points: int = 0  # number of points that are also searched from random starts


class RefinedFront(NamedTuple):
    """A certified front, whether each refined point converged, and whether an observer ended the refinement."""

    front: Front
    converged: Bool[np.ndarray, " points"]
    ended: bool


def refined_front(
    certifier: Certifier,
    x: Points,
    ids: Ids,
    ranges: Values,
    provenance: Mapping[str, Any],
    *,
    before: Front | None = None,
    completion: Completion | None = None,
) -> RefinedFront:
    """Return the refined and certified front of points, with new points if ``completion`` is given.

    Points that became worse than on the front ``before`` are restored.
    """
    formulation = certifier.formulation
    with certifier.reserve_later(len(x)):
        then = "" if completion is None else "optimum"
        x, converged, ranges, ended = _refine_over_own_ranges(certifier, x, ranges, then)
        if completion is not None:
            assert before is not None
            x = no_worse(formulation, formulation.individuals(x), before, ranges).x
            before = None
            if len(ranges) > 1 and len(x):
                x, ids, ranges = _completed(completion, certifier, x, ids, ranges)
    front = certified_front(certifier, x, ids, ranges, provenance, before=before)
    return RefinedFront(front, converged, ended)


def _refine_over_own_ranges(
    certifier: Certifier, x: Points, ranges: Values, then: str
) -> tuple[Points, Bool[np.ndarray, " points"], Values, bool]:
    """Return refined points, converged flags, ranges, and whether an observer ended the refinement.

    The ranges are approximately those of the points' front. ``then`` names the stage that follows; if there is one, the
    time left is not shown.
    """
    formulation, observe, following = certifier.formulation, certifier.observe, " and ".join(certifier.later_stages)
    ended, shares = False, np.ones(len(ranges))

    def show(done: int, total: int, point: Point) -> object:
        nonlocal ended
        if count is not None:
            if not then and is_due(observe):
                certifier.try_point(point, ranges, computing_clock() - began)
            ended = bool(count(done, total, words))
        return ended

    for number in range(OPTIONS.rounds):
        words = f"round {number + 1}" if number else ""
        count = count_observer(
            observe, "refinement", later=certifier.per_point, uniform=not then, then=then, following=following
        )
        program, before, began = formulation.program(ranges * shares), shares, computing_clock()
        x, converged = refine(program, x, len(ranges), solver=certifier.solver, observe=show)
        values = evaluate_points(program, x).objectives[:, : len(ranges)] * before
        widths = np.ptp(values[front_rows(values)], axis=0)
        shares = np.where(widths > POINT_TOLERANCE, np.maximum(widths, OPTIONS.smallest_share), before)
        if ended or STOP[0] or (shares > OPTIONS.shrinkage * before).all():
            break
    return x, converged, ranges * before, ended


def _completed(
    completion: Completion, certifier: Certifier, x: Points, ids: Ids, ranges: Values
) -> tuple[Float[np.ndarray, " completed *point"], Int[np.ndarray, " completed"], Values]:
    """Return the points with new ones added, if any, their ids, and the ranges."""
    formulation, solver, observe = certifier.formulation, certifier.solver, certifier.observe
    began = computing_clock()

    def show_point(progress: SweepProgress) -> object:
        assert observe is not None
        return observe(certifier.point_progress(progress, computing_clock() - began))

    with suppress(Infeasible, SolverFailed, Interrupted):
        check_interruption()
        shown = count_observer(observe, "optimum")
        cold = formulation.cold_search(starts=completion.starts, seed=completion.seed, solver=solver, observe=shown)
        began = computing_clock()
        new, new_ranges = epsilon_points(
            formulation.program,
            cold,
            len(ranges),
            points=max(completion.points, 2),
            initial=x,
            refined=True,
            cold_points=completion.cold_points,
            solver=solver,
            observe=None if observe is None else show_point,
        )
        # Former points keep their ids; those of new points count from ``first_id`` on.
        ids_before = {one.tobytes(): int(each) for one, each in zip(x, ids, strict=True)}
        numbers = [ids_before.get(one.tobytes(), completion.first_id + i) for i, one in enumerate(new)]
        return new, np.array(numbers, dtype=np.int64), new_ranges
    return x, ids, ranges


def merge_front(front: Front, formulation: Differentiable, x: Points, first_id: int) -> Front:
    """Return the nondominated points of a front and of further feasible points.

    Genes are None if a further point is on the front: genes would only approximate it.
    """
    individuals = formulation.individuals(x)
    violation = evaluate_points(formulation.program(), x).violation
    values = np.concatenate([front.minimised, individuals.objectives])
    shares = values / ranges_of(values)
    feasible = np.flatnonzero(np.append(np.ones(len(front), dtype=bool), violation <= FEASIBLE))
    rows = feasible[non_dominated(shares[feasible])]
    if (rows < len(front)).all():
        return front
    old = formulation.front_points(front) if len(front) else x[:0]
    both = formulation.individuals(np.concatenate([old, x])[rows])
    objectives = both.objectives * np.where(formulation.maximised, -1.0, 1.0)
    violations = np.zeros(len(front)) if front.violation is None else front.violation
    return replace(
        front,
        ids=np.concatenate([front.ids, first_id + np.arange(len(x))])[rows],
        objectives=objectives,
        genes=None,
        motions=both.motions,
        violation=np.concatenate([violations, violation])[rows],
        ranges=np.stack([objectives.min(axis=0), objectives.max(axis=0)], axis=1),
    )

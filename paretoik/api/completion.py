"""Complete a searched front: its points refined, the planner's ends added and its gaps filled, all of it certified."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.api.certificate_time import LaterStages, LaterTime
from paretoik.api.progress import Observer, RunProgress, count_observer
from paretoik.api.refine import refine_front
from paretoik.api.sweep_words import phase_text
from paretoik.arrays import Ids, Points
from paretoik.compilation_notices import computing_clock
from paretoik.errors import Infeasible, SolverFailed
from paretoik.formulations.protocol import Differentiable
from paretoik.front.front import Front
from paretoik.nlp.program import Solver
from paretoik.pareto.epsilon import epsilon_points
from paretoik.pareto.sweep import ObserveSweep, SweepProgress
from paretoik.stop_flag import Interrupted, check_interruption


@dataclass(frozen=True, kw_only=True)
class CompletionOptions:
    """From so many ``starts`` each objective is planned; so many points are sought from ``cold_points`` starts too.

    What a search has looked for need not be looked for as long as from nothing.
    """

    starts: int = 24
    cold_points: int = 0


OPTIONS = CompletionOptions()


def complete_front(
    front: Front, *, points: int, seed: int, first_id: int, solver: Solver, observe: Observer | None
) -> Front:
    """Return a front as ``refine`` does, with at most so many ``points``, or its own where these are more.

    Among them are the ends that ``plan`` finds, and new ones where gaps gain the most; their ids begin at ``first_id``.
    Where the planner finds nothing, the front is refined and no more.
    """

    def complete(
        formulation: Differentiable,
        x: Points,
        ids: Ids,
        ranges: Float[np.ndarray, " n_obj"],
        shown: Observer | None,
        later: LaterTime,
    ) -> tuple[Points, Ids, Float[np.ndarray, " n_obj"]]:
        if len(ranges) < 2 or not len(x):
            return x, ids, ranges
        with suppress(Infeasible, SolverFailed, Interrupted):
            check_interruption()
            cold = formulation.cold_search(
                starts=OPTIONS.starts, seed=seed, solver=solver, observe=count_observer(shown, "optimum")
            )
            complete_x, complete_ranges = epsilon_points(
                formulation.program,
                cold,
                len(ranges),
                points=max(points, 2),
                initial=x,
                refined=True,
                cold_points=OPTIONS.cold_points,
                solver=solver,
                observe=_point_observer(shown, LaterStages.of(front.problem).text, later),
            )
            return complete_x, _ids(complete_x, x, ids, first_id), complete_ranges
        return x, ids, ranges

    return refine_front(front, front.problem, solver=solver, observe=observe, complete=complete)


def _point_observer(observe: Observer | None, following: str, later: LaterTime) -> ObserveSweep | None:
    if observe is None:
        return None
    started = computing_clock()

    def show(progress: SweepProgress) -> object:
        seconds = computing_clock() - started
        return observe(
            RunProgress(
                stage="point",
                done=progress.done,
                total=progress.total,
                seconds=seconds,
                remaining=later.sweep_left(progress, seconds) if getattr(observe, "is_due", True) else None,
                summary=phase_text(progress.phase),
                following=following,
            )
        )

    return show


def _ids(x: Points, before: Float[np.ndarray, " before *point"], ids: np.ndarray, first_id: int) -> np.ndarray:
    """Return the ids of points: those that they had before, and new ones from ``first_id`` on."""
    ids_before = {one.tobytes(): int(each) for one, each in zip(before, ids, strict=True)}
    return np.array([ids_before.get(one.tobytes(), first_id + i) for i, one in enumerate(x)], dtype=np.int64)

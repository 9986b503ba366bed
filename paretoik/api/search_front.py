"""Search for a front: an evolutionary search with its endings, refined where wanted, kept and drawn."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from paretoik.api.completion import complete_front
from paretoik.api.generation_motions import GenerationMotions
from paretoik.api.initial import InitialSolutions, merge_front
from paretoik.api.least_violating import (
    finish_infeasible,
    infeasible_error,
    least_violating,
    least_violating_end,
    nearest_motion,
)
from paretoik.api.progress import RunProgress
from paretoik.api.refine import SearchImprover
from paretoik.api.review_front import review_front
from paretoik.api.run_session import RunSession
from paretoik.api.settings import DEFAULTS, SolveSettings
from paretoik.api.verb_session import computing
from paretoik.compilation_notices import computing_clock
from paretoik.errors import Infeasible, InvalidInput, SolverFailed
from paretoik.execution.time_limit import TimeLimit as CallTimeLimit
from paretoik.execution.time_limit import check_time_limit
from paretoik.formulations.closed_loop_arguments import read_steps
from paretoik.formulations.protocol import has_branches, require_feasible
from paretoik.formulations.requirements import require_program
from paretoik.front.front import Front
from paretoik.front.hypervolume_curve import HypervolumeCurve
from paretoik.inputs import check_size, real_array, shown
from paretoik.nlp.minimise import check_solver
from paretoik.review.recording.recorder import Generation, SearchEnd
from paretoik.review.recording.workcell import workcell_of
from paretoik.run_files import STOPPED
from paretoik.search.ask_tell import Search
from paretoik.search.endings import Ending, Evaluations, Generations, Progress, Stagnation, Target, TimeLimit
from paretoik.search.evolution import evolve
from paretoik.search.islands import Islands
from paretoik.search.seeding import check_sizes
from paretoik.stop_flag import Interrupted

INTERRUPTED = tuple(status for status in STOPPED if status != "time limit")


class FrontSearch:
    """The search of a pymoo problem's front by ``settings``, checked before anything is computed or written.

    Raises InvalidInput, naming the setting.
    """

    def __init__(self, problem: Any, settings: SolveSettings) -> None:
        check_sizes(problem)
        if read_steps(settings.record_steps):
            raise InvalidInput(
                f"record_steps: a ClosedLoop wanted, whose steps are searches, got {type(problem).__name__}"
            )
        if settings.refine:
            check_time_limit(settings.time_limit)
            with computing(settings.time_limit):  # users' functions are traced
                check_solver(require_program("refine", problem).program(), settings.solver)
        elif settings.solver != "auto":
            raise InvalidInput(f"solver: wants refine=True, got {shown(settings.solver)} without it")
        self.problem = problem
        self.generations = DEFAULTS.generations if settings.generations is None else settings.generations
        check_size("generations", self.generations, 1)
        population = DEFAULTS.population if settings.population is None else settings.population
        seed = DEFAULTS.seed if settings.seed is None else settings.seed
        if settings.points is not None:
            check_size("points", settings.points, 1)
        anchors = _anchors(problem, settings, self.generations)
        self._initial = InitialSolutions.of(problem, settings.initial)
        search = Search if settings.islands == 1 else partial(Islands, islands=settings.islands)
        self.search: Search | Islands = search(
            problem,
            population=population,
            seed=seed,
            algorithm=settings.algorithm,
            initial=self._initial.genes,
            anchors=anchors,
        )
        self.improver = SearchImprover(self.search, settings.solver) if settings.refine else None
        self.endings = _endings(self.search, settings, self.generations, anchors)
        self._solve_settings = settings
        self._motions = GenerationMotions(self.search)
        self._hypervolume = HypervolumeCurve()
        self.settings = {
            "population": population,
            "generations": self.generations,
            "seed": seed,
            "islands": settings.islands,
            "initial": settings.initial is not None,
            "anchors": anchors,
            "algorithm": None if settings.algorithm is None else type(settings.algorithm).__name__,
            "evaluations": settings.evaluations,
            "target": None if settings.target is None else [_json_number(value) for value in settings.target],
            "stagnation": settings.stagnation,
            "points": settings.points,
            "refine": settings.refine,
            "solver": settings.solver,
            "evaluation_timeout": settings.evaluation_timeout,
            "time_limit": settings.time_limit,
        }

    def run(self, session: RunSession) -> Front:
        """Return the front that the search leads to, refined unless a signal came."""
        session.continues, started = True, computing_clock()
        front = self._evolve(session)
        if not self._solve_settings.refine or front.provenance["status"] in INTERRUPTED:
            return front
        session.save_draft(front)  # refining takes its time, and the search is not to be lost

        def observe(progress: RunProgress) -> bool:
            session.show(progress)
            return session.stopped_by is not None

        settings, status = self._solve_settings, front.provenance["status"]
        spent = computing_clock() - started
        remaining = None if settings.time_limit is None else max(settings.time_limit - spent, 1e-3)
        with session.computing(remaining):
            front = complete_front(
                front,
                points=len(front) if settings.points is None else settings.points,
                seed=DEFAULTS.seed if settings.seed is None else settings.seed,
                first_id=max(self.search.evaluations, int(front.ids.max()) + 1),
                solver=settings.solver,
                observe=observe,
            )
        status = session.stopped_by or status
        counts = {**front.provenance["counts"], "seconds": round(session.seconds, 3)}
        ending = {"status": status, "counts": counts, "computed": session.provenance["computed"]}
        return replace(front, provenance={**front.provenance, **ending})

    def review(self, front: Front, session: RunSession) -> None:
        """Finish the recording and draw the front."""
        review_front(front, session)

    def _evolve(self, session: RunSession) -> Front:
        search = self.search
        self._initial.remember()
        session.start(
            names=search.names,
            units=search.units,
            maximised=search.maximised,
            timeline="generation",
            workcell=workcell_of(self.problem),
        )
        observe = partial(self._show, session)
        hopeless = _Hopeless(self.problem)
        endings = [*self.endings, _Signal(session), *([hopeless] if self._initial.genes is None else [])]
        limit = CallTimeLimit(
            seconds=min((each.seconds for each in endings if isinstance(each, TimeLimit)), default=None)
        )
        try:
            with limit.limiting_calls():
                status = evolve(
                    search,
                    endings,
                    seconds=self._solve_settings.evaluation_timeout,
                    observe=observe,
                    improve=self.improver,
                )
        except Exception as error:  # a user's function, or observer, may fail late
            if len(search.archive.F):
                session.keep_found(self._front(session, type(error).__name__), error)
            raise
        if limit.late:
            status = "time limit"
            if not search.generation:
                text = f"nothing was found within {limit.seconds:g} s; {limit.late} took longer than that"
                raise SolverFailed(f"time_limit: {text}")
        front = self._front(session, session.signal or status)
        if not len(front):
            if hopeless.failure is None:
                failure = infeasible_error(search)
                nearest = least_violating_end(search, failure)
            else:
                failure = hopeless.failure
                nearest = nearest_motion(self.problem, failure)
            finish_infeasible(session, search, failure, nearest, SearchEnd(front=None, least_violating=nearest))
            if session.signal is None:
                raise failure
            stop = Interrupted()
            stop.add_note(f"by then there was {failure}")
            raise stop
        return front

    def _front(self, session: RunSession, status: str) -> Front:
        """Return the front that the search has led to."""
        search = self.search
        front = search.front_of(self._solve_settings.points)
        if self._initial.points is not None:
            front = merge_front(front, require_program("solve", self.problem), self._initial.points, search.evaluations)
        counts = {
            "generations": search.generation,
            "evaluations": search.evaluations,
            "iterations": 0 if self.improver is None else self.improver.spent,
            "failed": search.failed.count,
            "first_cause": search.failed.first_cause,
            "seconds": round(session.seconds, 3),
        }
        return replace(
            front,
            problem=search.problem,
            provenance={**session.provenance, "status": status, "counts": counts},
        )

    def _show(self, session: RunSession, progress: Progress) -> None:
        """Show a generation in the user's own sign."""
        if not session.is_watched:
            return
        signs, front, failed = np.where(self.search.maximised, -1.0, 1.0), progress.front, progress.failed.count
        number, curve = progress.generation, self._hypervolume
        corner = curve.corner(front)
        volume = curve.measure(front, number) if session.is_observed else None  # a recording computes its own
        generation = Generation(
            number=number,
            population=progress.population[np.isfinite(progress.population).all(axis=1)] * signs,
            front=front * signs,
            front_ids=progress.ids,
            hypervolume=volume,
            reference=None if corner is None else corner * signs,
            failed=failed,
            least_violating=None if session.recorder is None else least_violating(self.search),
            points=() if session.recorder is None else self._motions.points(progress),
        )
        shown = RunProgress(
            stage="generation",
            done=number,
            total=self.generations,
            seconds=progress.seconds,
            summary=f"front {len(front)}, {curve.summary(number)}" + (f", {failed} failed" if failed else ""),
            generation=generation,
            then="refinement" if self._solve_settings.refine else "",
        )
        session.show(shown)


@dataclass(frozen=True)
class _Signal:
    """Ends a search when a signal came."""

    session: RunSession
    memory: int = field(default=0, init=False, repr=False)

    def reached(self, progress: Progress) -> str | None:
        """Return the name of the signal, if any."""
        return self.session.signal


class _Hopeless:
    """Ends a search after its first generation if nothing is feasible and limits clearly cannot hold: ``failure``."""

    memory = 0

    def __init__(self, problem: Any) -> None:
        self.failure: Infeasible | None = None
        self._problem, self._looked = problem, False

    def reached(self, progress: Progress) -> str | None:
        """Return "infeasible" if that is clear after the first generation."""
        if self._looked or len(progress.front):
            return None
        self._looked = True
        try:
            require_feasible(self._problem)
        except Infeasible as failure:
            self.failure = failure
            return "infeasible"
        return None


def _anchors(problem: Any, settings: SolveSettings, generations: int) -> int:
    """Return the generations for each objective alone: by default half of all, shared, where there are branches."""
    if settings.anchors is not None:
        return settings.anchors
    branches = settings.algorithm is None and problem.n_obj > 1 and has_branches(problem)
    return generations // (2 * problem.n_obj) if branches else 0


def _endings(search: Search | Islands, settings: SolveSettings, generations: int, anchors: int) -> list[Ending]:
    endings: list[Ending] = [Generations(generations)]
    if settings.time_limit is not None:
        limit = TimeLimit(settings.time_limit)
        endings.append(replace(limit, seconds=DEFAULTS.search_time * limit.seconds) if settings.refine else limit)
    if settings.evaluations is not None:
        endings.append(Evaluations(settings.evaluations))
    if settings.target is not None:
        values = real_array("target", settings.target)
        if values.shape != (len(search.names),):
            raise InvalidInput(
                f"target: wants {len(search.names)} numbers, one an objective, got {shown(settings.target)}"
            )
        endings.append(Target(tuple(np.where(search.maximised, -values, values).tolist())))
    if settings.stagnation:
        endings.append(Stagnation(since=anchors * search.problem.n_obj))
    return endings


def _json_number(value: float) -> float | str:
    """Return a number, which may be infinite, as strict JSON can hold it."""
    return float(value) if np.isfinite(value) else str(value)

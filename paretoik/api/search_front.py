"""Search for a front; refine it on request; save and draw it."""

from __future__ import annotations

import time
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np

from paretoik.api.initial import InitialSolutions
from paretoik.api.refine import refine_front
from paretoik.api.session import DEFAULTS, Session, SolveSettings, computing
from paretoik.compilation_notices import computing_clock
from paretoik.errors import Infeasible, InvalidInput, SolverFailed
from paretoik.formulations.control_step import read_steps
from paretoik.formulations.protocol import ProblemParts, explain_violation, require_program, violation_words
from paretoik.front.front import Front
from paretoik.front.hypervolume import HypervolumeCurve
from paretoik.front.preferences.compromise import marked_rows
from paretoik.inputs import check_size, real_array, shown
from paretoik.nlp.minimise import check_solver
from paretoik.pareto.refine import SearchImprover
from paretoik.pareto.refined_front import Completion, merge_front
from paretoik.progress import RunProgress, is_due
from paretoik.review.recording.messages import LeastViolating, RecordedPoint, record_motion
from paretoik.review.recording.recorder import Generation
from paretoik.runs.files import STOPPED
from paretoik.runs.interruption import TimeLimit as CallTimeLimit
from paretoik.search.ask_tell import Search
from paretoik.search.endings import Ending, Evaluations, Generations, Progress, Stagnation, Target, TimeLimit
from paretoik.search.evolution import evolve
from paretoik.search.genes import check_sizes
from paretoik.search.islands import Islands
from paretoik.stop_flag import Interrupted

# The points of each generation that a recording marks, and their motions if there is time.


@dataclass(frozen=True, kw_only=True)
class MotionOptions:
    """Settings of motions that are decoded for a recording.

    share: largest share of the run's time for decoding
    dense: number of motions decoded one generation after another, then as many every second, every fourth, ...
    samples: most samples of a motion
    """

    share: float = 0.01
    dense: int = 60
    samples: int = 401


OPTIONS = MotionOptions()


class GenerationMotions:
    """Finds the best point per objective and the compromise of a generation."""

    def __init__(self, search: Search | Islands) -> None:
        self._search = search
        self._shown: list[int] = []  # ids whose motions were decoded last
        self._decoded = 0
        self._next = 0
        self._spent, self._started = 0.0, time.monotonic()
        self._moves = True

    def points(self, progress: Progress) -> tuple[RecordedPoint, ...]:
        """Return these points, with motions if they changed and time allows."""
        if not len(progress.front):
            return ()
        marked = marked_rows(progress.front, progress.ids)
        signs = np.where(self._search.maximised, -1.0, 1.0)
        points = tuple(
            RecordedPoint(id=int(progress.ids[row]), objectives=progress.front[row] * signs, axis=axis)
            for row, axis in marked
        )
        ids, started = [point.id for point in points], time.monotonic()
        has_time = self._spent <= OPTIONS.share * (started - self._started)
        if not self._moves or ids == self._shown or progress.generation < self._next or not has_time:
            return points
        members = self._search.archive.members
        assert members is not None
        unique, place = np.unique([row for row, _ in marked], return_inverse=True)
        motions = ProblemParts(self._search.problem).decode(members.X[unique])
        self._moves = motions is not None
        if motions is not None:
            points = tuple(
                replace(point, motion=record_motion(motions[int(i)], curves=False, samples=OPTIONS.samples))
                for point, i in zip(points, place, strict=True)
            )
        self._spent += time.monotonic() - started
        self._shown, self._decoded = ids, self._decoded + 1
        self._next = progress.generation + 2 ** (self._decoded // OPTIONS.dense)
        return points


# The evolutionary search for a front.


INTERRUPTED = tuple(status for status in STOPPED if status != "time limit")
NOT_STORED = ("record_steps", "workers", "cluster")  # settings that are not in `run.json`


class FrontSearch:
    """The search for the front of a pymoo problem with ``settings``.

    The settings are checked before any computation. Raises InvalidInput, naming the setting.
    """

    def __init__(self, problem: Any, settings: SolveSettings) -> None:
        check_sizes(problem)
        if read_steps(settings.record_steps):
            raise InvalidInput(
                f"record_steps must come with a ClosedLoop, whose steps are searches, got {type(problem).__name__}"
            )
        if settings.refine:
            with computing(settings.time_limit):  # users' functions are traced
                check_solver(require_program("refine", problem).program(), settings.solver)
        elif settings.solver != "auto":
            raise InvalidInput(f"solver must come with refine=True, got {shown(settings.solver)} without it")
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
        self.improver = SearchImprover(self.search, problem, settings.solver) if settings.refine else None
        self.endings = _endings(self.search, settings, self.generations, anchors)
        self._given = settings
        self._motions = GenerationMotions(self.search)
        self._hypervolume = HypervolumeCurve()
        target = settings.target  # an infinite number is text in strict JSON
        used: dict[str, Any] = {
            "population": population,
            "generations": self.generations,
            "seed": seed,
            "initial": settings.initial is not None,
            "anchors": anchors,
            "algorithm": None if settings.algorithm is None else type(settings.algorithm).__name__,
            "target": None if target is None else [float(each) if np.isfinite(each) else str(each) for each in target],
        }
        names = [each.name for each in fields(settings) if each.name not in NOT_STORED]
        self.settings = {name: used[name] if name in used else getattr(settings, name) for name in names}

    def run(self, session: Session) -> Front:
        """Return the saved and drawn front, refined unless a signal came."""
        session.continues, started = True, computing_clock()
        front = self._evolve(session)
        if self._given.refine and front.provenance["status"] not in INTERRUPTED:
            session.save_draft(front)  # refinement takes a while, and the search must not be lost
            front = self._refined(front, session, computing_clock() - started)
        session.finish_front(front)
        return front

    def _refined(self, front: Front, session: Session, spent: float) -> Front:
        """Return the refined and completed front.

        ``spent``: seconds that the search took.
        """
        settings, status = self._given, front.provenance["status"]
        completion = Completion(
            points=len(front) if settings.points is None else settings.points,
            seed=self.settings["seed"],
            first_id=max(self.search.evaluations, int(front.ids.max()) + 1),
        )
        remaining = None if settings.time_limit is None else max(settings.time_limit - spent, 1e-3)
        with computing(remaining, session):
            front = refine_front(
                front, front.problem, solver=settings.solver, observe=session.show, completion=completion
            )
        counts = {**front.provenance["counts"], "seconds": round(session.seconds, 3)}
        status, computed = session.stopped_by or status, session.provenance["computed"]
        return replace(front, provenance={**front.provenance, "status": status, "counts": counts, "computed": computed})

    def _evolve(self, session: Session) -> Front:
        """Return the front of the search, not refined."""
        search = self.search
        hopeless = _SignalOrHopeless(session, self.problem, looks=self._initial.genes is None)
        self._initial.remember()
        session.record_search(search, "generation")
        endings = [*self.endings, hopeless]
        seconds = min((each.seconds for each in endings if isinstance(each, TimeLimit)), default=None)
        limit = CallTimeLimit(seconds=seconds)
        try:
            with limit.limiting_calls():
                status = evolve(
                    search,
                    endings,
                    seconds=self._given.evaluation_timeout,
                    observe=partial(self._show, session),
                    improve=self.improver,
                )
        except Exception as error:  # a user's function or observer may fail after many generations
            if len(search.archive.F):
                session.keep_found(self._front(session, type(error).__name__), error)
            raise
        if limit.late:
            status = "time limit"
            if not search.generation:
                text = f"nothing was found within {limit.seconds:g} s; {limit.late} took longer than that"
                raise SolverFailed(f"time_limit: {text}")
        front = self._front(session, session.signal or status)
        if len(front):
            return front
        failure = hopeless.failure
        if failure is None:
            failure, session.nearest = infeasible_search(search)
        if session.signal is None:
            raise failure
        raise Interrupted from failure

    def _front(self, session: Session, status: str) -> Front:
        """Return the front of the search so far."""
        search = self.search
        front = search.front_of(self._given.points)
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

    def _show(self, session: Session, progress: Progress) -> None:
        """Show a generation, with objectives in the user's own sign."""
        if not session.is_watched:
            return
        signs, front, failed = np.where(self.search.maximised, -1.0, 1.0), progress.front, progress.failed.count
        number, curve = progress.generation, self._hypervolume
        corner = curve.corner(front)
        volume = curve.measure(front, number) if is_due(session.observe) else None  # a recording computes its own
        nearest = None if session.recorder is None else self.search.archive.least_violating
        broken = None if nearest is None else violation_words(self.search.problem, nearest.G[0])
        generation = Generation(
            number=number,
            population=progress.population[np.isfinite(progress.population).all(axis=1)] * signs,
            front=front * signs,
            front_ids=progress.ids,
            hypervolume=volume,
            reference=None if corner is None else corner * signs,
            failed=failed,
            least_violating=None if broken is None else LeastViolating(broken=broken),
            points=() if session.recorder is None else self._motions.points(progress),
        )
        shown = RunProgress(
            stage="generation",
            done=number,
            total=self.generations,
            seconds=progress.seconds,
            summary=f"front {len(front)}, {curve.summary(number)}" + (f", {failed} failed" if failed else ""),
            generation=generation,
            then="refinement" if self._given.refine else "",
        )
        session.show(shown)


class _SignalOrHopeless:
    """Ends a search after a signal, or if it is clearly infeasible.

    Limits are checked once, after the first generation, if ``looks`` is True and the front is empty. ``failure`` names
    the limits that cannot be satisfied.
    """

    memory = 0

    def __init__(self, session: Session, problem: Any, *, looks: bool) -> None:
        self.failure: Infeasible | None = None
        self._session, self._problem, self._looks = session, problem, looks

    def reached(self, progress: Progress) -> str | None:
        """Return the name of the signal, "infeasible", or None."""
        if self._session.signal is not None or not self._looks or len(progress.front):
            return self._session.signal
        self._looks = False
        try:
            ProblemParts(self._problem).require_feasible()
        except Infeasible as failure:
            self.failure = failure
            return "infeasible"
        return None


def infeasible_search(search: Search | Islands) -> tuple[Infeasible, LeastViolating]:
    """Return the error of an infeasible search and its least-violating point.

    The point is in the form that a recording shows at its end.
    """
    nearest = search.archive.least_violating
    if nearest is None:
        failure = Infeasible(f"no feasible point in {search.evaluations} evaluations, and none without a failure")
        return failure, LeastViolating(broken=(), reason=str(failure))
    limit, reason = explain_violation(search.problem, nearest.X, nearest.G[0])
    motions = ProblemParts(search.problem).decode(nearest.X)
    failure = Infeasible(
        f"no motion within the limits in {search.evaluations} evaluations; of the least-violating one, {reason}",
        motion=None if motions is None else motions[0],
        limit=limit,
        violation=float(nearest.G.max()),
    )
    objectives = nearest.F[0] * np.where(search.maximised, -1.0, 1.0)
    motion = record_motion(failure.motion, curves=True)
    point = RecordedPoint(id=int(nearest.ids[0]), objectives=objectives, motion=motion)
    return failure, LeastViolating(
        broken=violation_words(search.problem, nearest.G[0]), reason=str(failure), point=point
    )


def _anchors(problem: Any, settings: SolveSettings, generations: int) -> int:
    """Return the number of generations for each objective alone.

    Default: the objectives share half of all generations if there are branches, else 0.
    """
    if settings.anchors is not None:
        return settings.anchors
    branches = settings.algorithm is None and problem.n_obj > 1 and hasattr(problem, "species")
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
                f"target must be {len(search.names)} numbers, one per objective, got {shown(settings.target)}"
            )
        endings.append(Target(tuple(np.where(search.maximised, -values, values).tolist())))
    if settings.stagnation:
        endings.append(Stagnation(since=anchors * search.problem.n_obj))
    return endings

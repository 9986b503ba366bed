"""Find the Pareto front of a problem, or run a closed loop."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.initial import genes_and_points, remembered_initial
from paretoik.api.refine import refine_front
from paretoik.api.session import RunRequest, Session, SolveSettings, computing, open_session, surroundings
from paretoik.arrays import Genes
from paretoik.closed_loop.loop import StepRecord, choose, nondominated_rows
from paretoik.closed_loop.step_evolution import Generations as StepGenerations
from paretoik.compilation_notices import computing_clock
from paretoik.errors import Infeasible, InvalidInput, SolverFailed
from paretoik.formulations.closed_loop import ClosedLoop, ClosedLoopRun, explain_choice
from paretoik.formulations.control_step import check_steps, read_steps
from paretoik.formulations.protocol import ProblemParts, explain_violation, require_program, timeline, violation_words
from paretoik.front.front import Front
from paretoik.front.hypervolume import HypervolumeCurve
from paretoik.front.preferences.knee_and_compromise import marked_rows
from paretoik.inputs import check_size, real_array, shown
from paretoik.nlp.minimise import check_solver
from paretoik.nlp.program import Solver
from paretoik.pareto.refine import SearchImprover
from paretoik.pareto.refined_front import Completion, merge_front
from paretoik.progress import Observer, RunProgress, is_due
from paretoik.review.recording.messages import LeastViolating, RecordedPoint, record_motion, workcell_of
from paretoik.review.recording.recorder import Generation, SearchedFront, SearchedStep, SearchEnd
from paretoik.runs.file_replacement import replace_file
from paretoik.runs.files import PICTURE, SEARCHES, STEPS, STOPPED, array_bytes, table_bytes
from paretoik.runs.interruption import TimeLimit as CallTimeLimit
from paretoik.runs.interruption import limited_evaluations
from paretoik.search.ask_tell import Search
from paretoik.search.endings import Ending, Evaluations, Generations, Progress, Stagnation, Target, TimeLimit
from paretoik.search.evolution import evolve
from paretoik.search.genes import check_sizes
from paretoik.search.islands import Islands
from paretoik.stop_flag import Interrupted
from paretoik.task.motion import Motion


def solve(
    problem: Any,
    *,
    population: int | None = None,
    generations: int | None = None,
    seed: int | None = None,
    islands: int = 1,
    out: str | Path | None = None,
    initial: Genes | Motion | Front | None = None,
    time_limit: float | None = None,
    evaluations: int | None = None,
    target: Sequence[float] | None = None,
    stagnation: bool = True,
    anchors: int | None = None,
    algorithm: Any = None,
    points: int | None = 200,
    refine: bool = False,
    solver: Solver = "auto",
    workers: int | None = None,
    cluster: str | None = None,
    evaluation_timeout: float | None = None,
    overwrite: bool = False,
    record_steps: Sequence[int] = (),
    live: bool = False,
    reference: str | None = None,
    observe: Observer | bool | None = None,
) -> Front:
    """Return the Pareto front of a pymoo problem, or run a ``ClosedLoop``.

    Parameters
    ----------
    problem
        Pymoo problem (``Tracking``, ``PointToPoint``, ``DirectionalMaxima``, ``Tuning``, yours), or ``ClosedLoop``.
    population
        Size of the population (default 200, or that of the closed loop).
    generations
        Maximum number of generations (default 500, or that of the closed loop).
    seed
        Seed of all random numbers (default 0, or that of the closed loop); the same seed gives the same front.
    islands
        Number of populations (default 1). Every ten generations some of the best migrate to the next one, in a ring.
    out
        Folder for the run (default: none): run.json, front.parquet, motions.npz, review.rrd and front.png.
    initial
        Genes (rows, genes), motions on the path, or a former front to start from.
    time_limit
        Computing time [s], without compilation, after which the search ends (default: no limit).
    evaluations
        Number of evaluations after which the search ends (default: no limit).
    target
        Values, one per objective in its own sign, that end the search when one point reaches them.
    stagnation
        Whether to stop if the front has not improved for 20 generations (default True).
    anchors
        Generations per objective alone, before the common search; default: half of all, shared, if there are branches.
    algorithm
        Genetic algorithm of pymoo in place of ``MaxiMinNSGA2``, with its own population size.
    points
        Maximum number of points, spread by MaxiMin (default 200); None keeps all.
    refine
        Whether gradients help the search, refine its points and certify them (default False).
    solver
        Solver of ``refine``: "interior-point" (smooth functions), "sqp" (any); "auto" (default): the first if possible.
    workers
        Number of processes on this machine that evaluate individuals (default: only this process).
    cluster
        Address of a Dask scheduler, "tcp://HOST:PORT", whose workers evaluate individuals.
    evaluation_timeout
        Longest evaluation of one individual [s]; a longer one is ended and fails (default: no limit).
    overwrite
        Whether to replace a run in ``out`` (default False).
    record_steps
        Steps of a closed loop (from 1) whose searches are recorded generation by generation (default: none).
    live
        Whether to open a viewer on the recording in ``out`` during the run (default False).
    reference
        Name of the problem, ``file.py:name``, kept in the run for ``load_front``.
    observe
        Function called with a ``RunProgress``; default: a bar on a terminal; True: lines elsewhere too; False: nothing.

    Returns
    -------
    Front
        Front of the search; for a closed loop one point: its motion, with the mean of each objective over the steps.

    Raises
    ------
    InvalidInput
        If an argument cannot be used.
    Infeasible
        If nothing satisfied the limits; the error has the least-violating motion and the binding limit.
    EvaluationFailed
        If every evaluation failed; names the first cause.

    Notes
    -----
    Pymoo problems need real genes; the front has motions if the problem has ``decode``. ``front.select(Weights(...))``
    on the front of a closed loop runs the loop again with other weights at every step. Not for closed loops:
    ``islands``, ``initial``, ``evaluations``, ``target``, ``anchors``, ``algorithm``, ``refine``, ``solver``,
    ``workers``, ``cluster`` and ``evaluation_timeout``; ``points`` and ``stagnation`` have no effect on them.

    Ctrl-C and SIGTERM end the search, or the refinement, within a second or after the current generation, and keep the
    result. ``front.provenance`` has the cause of the end (``"status"``) and the effort (``"counts"``). If an
    objective or ``observe`` raises after the first generation, the front so far is the error's ``partial``, and it is
    saved in ``out``.

    ``refine`` works for ``Tracking``, ``DirectionalMaxima`` and ``PointToPoint``, as ``refine(front)`` does. Every ten
    generations a few iterations of the solver improve the best points of each objective, points at the widest gaps and
    points of every branch; they take up to 30 % of the evaluations. At the end every point is refined to a local
    optimum. The planner's best points of each objective are added, then points in gaps, up to ``points``; all are
    certified. The search takes at most half of a ``time_limit``. The time for compilation, once per copy of paretoik,
    does not count. "sqp" solves convex subproblems by Clarabel.

    On problems with branches the best points of single objectives can lie in basins of their own: by default the
    objectives share half of all generations as ``anchors``. Islands are evaluated together, which gives many
    ``workers`` more to do at a time.

    ``workers`` and ``cluster`` do not change the front, bit for bit. They save time only if an individual takes some
    milliseconds; a warning says if they do not. The problem is sent with its code, without files that it opens. An
    individual fails if four workers end on it. A cluster needs ``pip install "paretoik[cluster]"``, ``dask
    scheduler``, and ``dask worker ADDRESS --nworkers 8 --nthreads 1``. With ``evaluation_timeout`` individuals are
    evaluated one by one in workers, by default in one; the first individual of a new worker has 5 s more, to load code.

    The folder of a closed loop also has steps.parquet, and searches.npz with the recorded steps: populations, fronts,
    choices and arms, on the recording's timelines ``generation`` and ``individual``. Pictures are not drawn after a
    signal. The viewer of ``live`` opens on this machine; without a screen, stderr says at which address to attach one.

    ``observe`` is called after every generation or step, and every refined point.
    """
    given = locals()  # settings are arguments of the same names
    settings = SolveSettings(**{each.name: given[each.name] for each in fields(SolveSettings)})
    run: FrontSearch | LoopRun = (LoopRun if timeline(problem) == "step" else FrontSearch)(problem, settings)
    request = RunRequest(
        verb="solve",
        problem=run.problem,
        settings=run.settings,
        resumable=True,
        isolated=evaluation_timeout is not None,
        **surroundings(given),
    )
    with limited_evaluations(evaluation_timeout), open_session(request) as session:
        return run.run(session)


# The evolutionary search for a front.


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """Limits of a search's time, and of the motions that its recording shows.

    search_time: share of the time limit for the search if the front is refined too
    share: largest share of the run's time for decoding motions
    dense: number of decodings at every generation; then as many at every second one, every fourth one, ...
    samples: maximum number of samples of a motion
    """

    search_time: float = 0.5
    share: float = 0.01
    dense: int = 60
    samples: int = 401


OPTIONS = SearchOptions()
DEFAULTS: dict[str, Any] = {"population": 200, "generations": 500, "seed": 0}  # of settings that are None
NOT_STORED = ("record_steps", "workers", "cluster")  # settings that are not in `run.json`


class FrontSearch:
    """The search for the front of a pymoo problem; raises InvalidInput for invalid settings before it computes."""

    def __init__(self, problem: Any, settings: SolveSettings) -> None:
        check_sizes(problem)
        if read_steps(settings.record_steps):
            kind = type(problem).__name__
            raise InvalidInput(f"record_steps must come with a ClosedLoop, whose steps are searches, got {kind}")
        if settings.refine:
            with computing(settings.time_limit):  # users' functions are traced
                check_solver(require_program("refine", problem).program(), settings.solver)
        elif settings.solver != "auto":
            raise InvalidInput(f"solver must come with refine=True, got {shown(settings.solver)} without it")
        missing = {name: size for name, size in DEFAULTS.items() if getattr(settings, name) is None}
        given: Any = replace(settings, **missing)
        check_size("generations", given.generations, 1)
        if given.points is not None:
            check_size("points", given.points, 1)
        if given.anchors is None:  # with branches, single objectives share half of all generations
            branches = given.algorithm is None and problem.n_obj > 1 and hasattr(problem, "species")
            given = replace(given, anchors=given.generations // (2 * problem.n_obj) if branches else 0)
        self.problem, self._given = problem, given
        self._initial = genes_and_points(problem, given.initial)
        search = Search if given.islands == 1 else partial(Islands, islands=given.islands)
        self.search: Search | Islands = search(
            problem,
            population=given.population,
            seed=given.seed,
            algorithm=given.algorithm,
            initial=self._initial["genes"],
            anchors=given.anchors,
        )
        self.improver = SearchImprover(self.search, problem, given.solver) if given.refine else None
        self.endings: list[Ending] = [Generations(given.generations)]
        if given.time_limit is not None:
            limit = TimeLimit(given.time_limit)
            refined = replace(limit, seconds=OPTIONS.search_time * limit.seconds) if given.refine else limit
            self.endings.append(refined)
        if given.evaluations is not None:
            self.endings.append(Evaluations(given.evaluations))
        target = given.target
        if target is not None:
            values = real_array("target", target)
            if values.shape != (problem.n_obj,):
                wish = f"target must be {problem.n_obj} numbers, one per objective"
                raise InvalidInput(f"{wish}, got {shown(target)}")
            self.endings.append(Target(tuple(np.where(self.search.maximised, -values, values).tolist())))
        if given.stagnation:
            self.endings.append(Stagnation(since=given.anchors * problem.n_obj))
        self._motions, self._hypervolume = GenerationMotions(self.search), HypervolumeCurve()
        # In strict JSON an infinite number is text.
        wished = None if target is None else [float(each) if np.isfinite(each) else str(each) for each in target]
        algorithm = None if given.algorithm is None else type(given.algorithm).__name__
        stored = {"initial": given.initial is not None, "algorithm": algorithm, "target": wished}
        names = [each.name for each in fields(given) if each.name not in NOT_STORED]
        self.settings = {name: getattr(given, name) for name in names} | stored

    def run(self, session: Session) -> Front:
        """Search; refine unless a signal came; save, draw and return the front."""
        session.continues, started, given = True, computing_clock(), self._given
        search = self.search
        hopeless = _SignalOrHopeless(session, self.problem, looks=self._initial["genes"] is None)
        remembered_initial(**self._initial)
        session.record_search(search, "generation")
        endings = [*self.endings, hopeless]
        seconds = min((each.seconds for each in endings if isinstance(each, TimeLimit)), default=None)
        limit, observe = CallTimeLimit(seconds=seconds), partial(self._show, session)
        try:
            with limit.limiting_calls():
                timeout = given.evaluation_timeout
                status = evolve(search, endings, seconds=timeout, observe=observe, improve=self.improver)
        except Exception as error:  # a user's function or observer may fail after many generations
            if len(search.archive.F):
                session.keep_found(self._front(session, type(error).__name__), error)
            raise
        if limit.late:
            status = "time limit"
            if not search.generation:
                text = f"nothing was found within {limit.seconds:g} s; {limit.late} took longer than that"
                raise SolverFailed(f"time_limit: {text}")
        status = session.signal or status
        front = self._front(session, status)
        if not len(front):
            failure = hopeless.failure
            if failure is None:
                failure, session.nearest = infeasible_search(search)
            if session.signal is None:
                raise failure
            raise Interrupted from failure
        if given.refine and (status == "time limit" or status not in STOPPED):
            session.save_draft(front)  # refinement takes long, and the search must not be lost
            completion = Completion(
                points=len(front) if given.points is None else given.points,
                seed=self.settings["seed"],
                first_id=max(search.evaluations, int(front.ids.max()) + 1),
            )
            spent = computing_clock() - started
            remaining = None if given.time_limit is None else max(given.time_limit - spent, 1e-3)
            with computing(remaining, session):
                front = refine_front(
                    front, front.problem, solver=given.solver, observe=session.show, completion=completion
                )
            ending = session.ended(session.stopped_by or status, **front.provenance["counts"])
            front = replace(front, provenance={**front.provenance, **ending})
        session.finish_front(front)
        return front

    def _front(self, session: Session, status: str) -> Front:
        """Return the front of the search so far."""
        search = self.search
        front, given = search.front_of(self._given.points), self._initial["points"]
        if given is not None:
            front = merge_front(front, require_program("solve", self.problem), given, search.evaluations)
        counts = {
            "generations": search.generation,
            "evaluations": search.evaluations,
            "iterations": 0 if self.improver is None else self.improver.spent,
            "failed": search.failed.count,
            "first_cause": search.failed.first_cause,
        }
        return replace(front, problem=search.problem, provenance=session.ended(status, **counts))

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
            total=self._given.generations,
            seconds=progress.seconds,
            summary=f"front {len(front)}, {curve.summary(number)}" + (f", {failed} failed" if failed else ""),
            generation=generation,
            then="refinement" if self._given.refine else "",
        )
        session.show(shown)


class _SignalOrHopeless:
    """Ends a search after a signal, or if its limits cannot be satisfied (``failure``).

    Limits are checked once, after the first generation, if ``looks`` is True and the front is empty.
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
    """Return the error of an infeasible search, and its least-violating point for the recording's end."""
    nearest = search.archive.least_violating
    if nearest is None:
        failure = Infeasible(f"no feasible point in {search.evaluations} evaluations, and every one failed")
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
    broken = violation_words(search.problem, nearest.G[0])
    return failure, LeastViolating(broken=broken, reason=str(failure), point=point)


# The points of each generation that a recording marks, and their motions if there is time.


class GenerationMotions:
    """Finds the best point per objective and the compromise of a generation."""

    def __init__(self, search: Search | Islands) -> None:
        self._search = search
        self._shown: list[int] = []  # ids whose motions were decoded last
        self._decoded, self._next, self._moves = 0, 0, True
        self._spent, self._started = 0.0, time.monotonic()

    def points(self, progress: Progress) -> tuple[RecordedPoint, ...]:
        """Return the best points and the compromise, with motions if they changed and time allows."""
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


# A closed loop, run step by step; its motion is saved as a front of one point.


SEARCH_SETTINGS = (
    *("initial", "evaluations", "target", "anchors", "algorithm", "refine", "solver"),
    *("islands", "workers", "cluster", "evaluation_timeout"),
)  # settings that a closed loop does not have


class LoopRun:
    """The run of a closed loop, whose front has one point.

    The point is the motion, with the mean of each objective over the steps.

    If a signal or the time limit ends the run early, the motion has the steps so far. Raises InvalidInput, with its
    name, for a setting of a search.
    """

    def __init__(self, problem: ClosedLoop, settings: SolveSettings) -> None:
        for name in SEARCH_SETTINGS:
            value, default = getattr(settings, name), getattr(SolveSettings, name)
            if value is not default and not (isinstance(value, str | int | np.integer) and value == default):
                raise InvalidInput(
                    f"{name} must be used with a search for a front, got a closed loop, which is run step by step"
                )
        self.problem = problem.changed(
            population=settings.population, generations=settings.generations, seed=settings.seed
        )
        self.time_limit = settings.time_limit
        self.record_steps = sorted(check_steps(settings.record_steps, len(self.problem.task.times) - 1))
        kept = {name: getattr(self.problem, name) for name in ("population", "generations", "seed", "warm_start")}
        others = {"time_limit": settings.time_limit, "record_steps": self.record_steps}
        self.settings = {"weights": self.problem.named_weights, **kept, **others}

    def run(self, session: Session) -> Front:
        """Run the loop; save, draw and return a front of one point."""
        loop = self.problem
        steps = len(loop.task.times) - 1
        session.show(RunProgress(stage="beginning"))  # the search for a start may take a while
        loop.prepare()
        units, maximised = zip(*((each.unit, each.maximise) for each in loop.objectives), strict=True)
        senses: Any = {"units": units, "maximised": maximised}
        session.start_recording(SearchedFront(names=loop.names, timeline="step", workcell=workcell_of(loop), **senses))
        started = computing_clock()

        def show(step: StepRecord) -> None:
            F = step.front.F * loop.signs
            drawn: Any = {"population": F[:0], "front": F, "front_ids": np.arange(len(F)), "chosen": F[step.index]}
            generation = Generation(number=step.sample, **drawn)
            seconds = computing_clock() - started
            progress = RunProgress(stage="step", done=step.sample, total=steps, seconds=seconds)
            session.show(replace(progress, summary=f"front {len(F)}", generation=generation))

        def is_over() -> bool:
            late = self.time_limit is not None and computing_clock() - started >= self.time_limit
            return late or session.signal is not None

        run = loop.run(record_steps=self.record_steps, observe=show, should_stop=is_over)
        status, done = "end of the path", len(run.q) - 1
        if done < steps:
            status = session.signal or "time limit"
        front = run.front(session.ended(status, steps=done, of=steps))
        ranges = run.ranges * loop.signs[:, None]  # best and worst values in the user's own sign

        def end() -> SearchEnd:
            assert session.folder is not None
            recorded = [(one.sample, one.generations) for one in run.fronts.values() if one.generations is not None]
            searched = [_searched_step(run, sample, generations) for sample, generations in recorded]
            _save_steps(run, ranges, searched, session.folder)
            return SearchEnd(front=None, choice=explain_choice(front), searched=searched)

        def draw(folder: Path) -> None:
            from paretoik.review.pictures.motions import loop_picture  # here: matplotlib loads slowly

            loop_picture(run.motion, run.values, ranges, front, folder / PICTURE)

        session.finish(front, partial(front.save, overwrite=True), status=status, end=end, draw=draw)
        return front


def _searched_step(run: ClosedLoopRun, sample: int, generations: StepGenerations) -> SearchedStep:
    """Return the search of a step, with each generation's front and choice, in the user's own sign."""
    loop, fronts = run.loop, [nondominated_rows(F) for F in generations.F]
    pairs = zip(generations.F, fronts, strict=True)
    chosen = [front[choose(F[front], loop.weights)] if len(front) else -1 for F, front in pairs]
    position = loop.task.tasks[0].path.positions[sample]
    return SearchedStep(
        sample=sample,
        arm=loop.task.arm,
        objectives=generations.F * loop.signs,
        q=generations.q,
        fronts=fronts,
        chosen=np.array(chosen),
        target=np.pad(position, (0, 3 - len(position))),
    )


def _save_steps(run: ClosedLoopRun, ranges: np.ndarray, searched: Sequence[SearchedStep], folder: Path) -> None:
    """Write a table of the steps, and the recorded searches as plain arrays, all in the user's own sign.

    `steps.parquet` has one row per step: sample, time, and per objective the chosen, best and worst value on the front.
    `searches.npz` has one row per recorded step: ``steps`` (steps,), ``names`` and ``units`` (n_obj,), ``objectives``
    (steps, generations, individuals, n_obj), ``q`` (steps, generations, individuals, dof), ``on_front`` (steps,
    generations, individuals), and ``chosen`` (steps, generations): index of an individual, −1 if all failed.
    """
    import pyarrow as pa

    samples = np.arange(1, len(run.q))
    columns: dict[str, np.ndarray] = {"sample": samples, "time": run.task.times[samples]}
    for axis, name in enumerate(run.loop.names):
        columns[f"chosen {name}"] = run.values[:, axis]
        columns[f"best {name}"], columns[f"worst {name}"] = ranges[:, axis].T
    replace_file(folder / STEPS, table_bytes(pa.table(columns)))
    if not searched:
        return
    on_front = np.zeros((len(searched), *searched[0].q.shape[:2]), dtype=bool)
    for i, each in enumerate(searched):
        for number, front in enumerate(each.fronts):
            on_front[i, number, front] = True
    arrays = {
        "steps": np.array([each.sample for each in searched]),
        "names": np.array(run.loop.names, dtype=np.str_),
        "units": np.array([each.unit for each in run.loop.objectives], dtype=np.str_),
        "objectives": np.array([each.objectives for each in searched]),
        "q": np.array([each.q for each in searched]),
        "on_front": on_front,
        "chosen": np.array([each.chosen for each in searched]),
    }
    replace_file(folder / SEARCHES, array_bytes(arrays))

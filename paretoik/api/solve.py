"""The verbs of the face: solve a problem into a front, and open a front again."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.follow import Observer as Observer
from paretoik.api.follow import follow, versions
from paretoik.api.refine import Improver, SmoothImprover
from paretoik.api.refine import refine as refined
from paretoik.arrays import Genes, Objectives
from paretoik.errors import Infeasible, InvalidInput, ParetoikError, check_size
from paretoik.execution.interrupts import Interruption, interruptible
from paretoik.execution.run_folder import claim_folder
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.front.front import Choice, Front, Preference
from paretoik.front.indicators import hypervolume
from paretoik.front.preferences import Weights
from paretoik.loading import fingerprint, load_problem
from paretoik.pareto.refine import SmoothProblem
from paretoik.review.generation import Generation
from paretoik.review.recorder import Recorder
from paretoik.run_files import CERTIFICATES, PICTURE, RECORDING, write_run
from paretoik.search.ask_tell import Search
from paretoik.search.endings import Ending, Evaluations, Generations, Stagnation, Target, TimeLimit
from paretoik.search.evolution import evolve
from paretoik.search.progress import Progress
from paretoik.task.motion import Motion

POPULATION, GENERATIONS = 200, 500  # where none are given
SIGNALS = ("SIGINT", "SIGTERM", "interrupted")
EXACT = 1e-6  # rad or m: a motion that the genes miss by more is not the motion that was given


def solve(
    problem: Any,
    *,
    population: int | None = None,
    generations: int | None = None,
    seed: int | None = None,
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
    overwrite: bool = False,
    reference: str | None = None,
    observe: Observer | None = None,
    observe_refining: Callable[[int, int], object] | None = None,
) -> Front:
    """Search for the Pareto front of any pymoo problem and return it; follow a ``ClosedLoop``.

    A closed loop becomes a front of one point: the motion, of which every objective is the mean over the steps. Its
    ``front.select(Weights(...))`` follows the loop anew with other weights at every step.

    Parameters
    ----------
    problem
        A ``Tracking``, a ``ClosedLoop``, or any pymoo problem with real genes (its front then has no motions).
    population, generations, seed
        Size of the population (200), most generations (500), and the seed of all chance (0): the same seed gives the
        same front. A closed loop has its own where none are given.
    out
        Folder to keep the run in: run.json, front.parquet, motions.npz, review.rrd, front.png, of a closed loop
        steps.parquet too. ``overwrite`` allows it to replace a run that is there.
    initial
        Start from genes (rows, genes), motions on the path, or a former front.
    time_limit, evaluations, target, stagnation
        Further endings: seconds; a number of evaluations; values to be reached by one point (one an objective, in its
        own sign); whether to stop when the front has stood still for 20 generations.
    anchors
        Generations spent on each objective alone before all are searched together; None takes half of all, shared
        by the objectives, on problems with branches, where the ends of a front can lie in basins of their own.
    algorithm
        Any pymoo genetic algorithm in place of ``MaxiMinNSGA2``, with its own sizes.
    points
        Most points of the front: of more, those that MaxiMin spreads over it; None keeps all.
    refine
        Whether gradients help: every ten generations a few iterations at the ends, in the widest gaps and in every
        branch, up to 30 % of the evaluations; at the end every point is polished to a local optimum and certified,
        as far as no signal ended the search or the polishing, which comes after ``time_limit``. For a ``Tracking``,
        ``DirectionalMaxima`` and ``PointToPoint``, as with ``refine(front)``.
    reference
        Where the problem can be loaded from (``file.py:name``), kept in the run for ``load_front``.
    observe
        Called after every generation, or step, with its ``Generation`` and ``Progress``.
    observe_refining
        Called with the points polished so far and those wanted.

    Of a closed loop ``initial``, ``evaluations``, ``target``, ``anchors``, ``algorithm`` and ``refine`` mean nothing
    and are refused; ``points`` and ``stagnation`` have no effect.

    Ctrl-C and SIGTERM end the search after the generation under way and keep its result; why it ended stands in
    ``front.provenance["status"]``.

    Raises
    ------
    InvalidInput
        Naming what cannot be used.
    Infeasible
        Where nothing satisfied the limits: with the least-violating motion and the limit that binds.
    EvaluationFailed
        Where every evaluation failed, with the first cause.
    """
    if isinstance(problem, ClosedLoop):
        refused = {"initial": initial, "evaluations": evaluations, "target": target, "anchors": anchors}
        refused |= {"algorithm": algorithm, "refine": refine or None}
        for name in (name for name, value in refused.items() if value is not None):
            raise InvalidInput(f"{name}: wants a search for a front, got a closed loop, which is followed step by step")
        loop = problem.changed(population=population, generations=generations, seed=seed)
        return follow(loop, out=out, time_limit=time_limit, overwrite=overwrite, reference=reference, observe=observe)
    if not hasattr(problem, "n_obj"):
        raise InvalidInput(f"problem: a pymoo problem wanted, such as Tracking, got {problem!r}")
    population = POPULATION if population is None else population
    generations = GENERATIONS if generations is None else generations
    seed = 0 if seed is None else seed
    if points is not None:
        check_size("points", points, 1)
    if anchors is None:
        branches = algorithm is None and problem.n_obj > 1 and hasattr(problem, "species")
        anchors = generations // (2 * problem.n_obj) if branches else 0
    search = Search(
        problem,
        population=population,
        seed=seed,
        algorithm=algorithm,
        initial=_initial_genes(problem, initial),
        anchors=anchors,
    )
    improver: Improver | SmoothImprover | None = None
    if refine:
        improver = SmoothImprover(search, seed) if isinstance(problem, SmoothProblem) else Improver(search)
    settings = {
        "population": population,
        "generations": generations,
        "seed": seed,
        "anchors": anchors,
        "refine": refine,
        "time_limit": time_limit,
    }
    provenance = {
        "problem": reference,
        "fingerprint": fingerprint(problem),
        "settings": settings,
        "versions": versions(),
    }
    endings: list[Ending] = [Generations(generations)]
    endings += [TimeLimit(time_limit)] if time_limit is not None else []
    endings += [Evaluations(evaluations)] if evaluations is not None else []
    endings += [Target(_signed_target(search, target))] if target is not None else []
    endings += [Stagnation(since=anchors * problem.n_obj)] if stagnation else []
    with ExitStack() as stack:
        folder = None if out is None else stack.enter_context(claim_folder(out, overwrite=overwrite))
        interruption = stack.enter_context(interruptible())
        endings.append(_Interrupted(interruption))

        kept = list[Front]()

        def searched(recorder: Recorder | None) -> Front:
            front = _searched(search, endings, points, provenance, _Watch(search, observe, recorder), improver)
            if not refine or front.provenance["status"] in SIGNALS:
                return front
            if folder is not None:
                front.save(folder)  # polishing takes its time, and what was found is not to be lost
                kept.append(front)
            front = refined(front, observe=_until(interruption, observe_refining))
            ended = front.provenance["status"] if interruption.signal is None else interruption.signal.name
            return replace(front, provenance={**front.provenance, "status": ended})

        if folder is None:
            return searched(None)
        write_run(folder, {**provenance, "status": "running"})
        recorder = _recorder(folder, search, reference)
        stack.callback(recorder.close)
        try:
            front = searched(recorder)
        except Exception as error:
            said = {"status": type(error).__name__, "reason": str(error)}
            for front in kept:
                replace(front, provenance={**front.provenance, **said}).save(folder)
            if not kept:
                write_run(folder, {**provenance, **said})
            raise
        front.save(folder)
        _review(front, folder, recorder)
        return front


def load_front(folder: str | Path, problem: Any = None) -> Front:
    """Return the front of a run folder; its motions are whole where ``problem``, or the one the run names, can be had.

    Raises
    ------
    InvalidRun
        Where the folder is no run, or damaged.
    InvalidInput
        Where ``problem`` is not the one that the run solved.
    """
    front = Front.load(folder)
    named = front.provenance.get("problem")
    if problem is None and named is not None:
        try:
            problem = load_problem(str(named))
        except ParetoikError as error:
            warnings.warn(f"{folder}: motions come without their arm: {error}", RuntimeWarning, stacklevel=2)
            return front
    if problem is None or not (hasattr(problem, "task") or isinstance(problem, SmoothProblem)):
        return front
    if fingerprint(problem) != front.provenance.get("fingerprint"):
        raise InvalidInput(f"{folder}: wants the problem that the run solved, but its fingerprint is another")
    if isinstance(problem, SmoothProblem):
        decode: Callable[[np.ndarray], Motion] | None = getattr(problem, "decode", None)
        motions = None if decode is None or front.genes is None else decode(np.array(front.genes))
        return replace(front, motions=motions, problem=problem)
    joints = problem.task.arm.joint_names

    def rebuilt(times: np.ndarray, q: np.ndarray, joint_names: tuple[str, ...]) -> Motion:
        order = [joint_names.index(joint) for joint in joints]
        motion: Motion = problem.task.until(q.shape[-2]).motion(q[..., order])
        return motion

    return replace(Front.load(folder, motions=rebuilt), problem=problem)


def reweighed(front: Front, preference: Preference) -> ClosedLoop | None:
    """Return the closed loop that must be followed anew for a choice; None where the front has all there is.

    Raises
    ------
    InvalidInput
        Where ``preference`` is none of a closed loop's, or the loop of the run cannot be had.
    """
    if isinstance(front.problem, ClosedLoop):
        return front.problem.reweighed(front, preference)
    if "drift" in front.provenance:
        raise InvalidInput("select: wants the closed loop that the run followed, but its problem cannot be loaded")
    return None


@dataclass(frozen=True)
class _Interrupted:
    """Ends a search when a signal came."""

    interruption: Interruption
    memory: int = field(default=0, init=False, repr=False)

    def reached(self, progress: Progress) -> str | None:
        """Return the name of the signal that came, if any."""
        return None if self.interruption.signal is None else self.interruption.signal.name


class _Watch:
    """Shows each generation to the recorder and to whoever looks on."""

    def __init__(self, search: Search, observe: Observer | None, recorder: Recorder | None) -> None:
        self.search, self.observe, self.recorder = search, observe, recorder
        self.corner: Objectives | None = None  # of the hypervolume: fixed by the first front, so that it can only grow

    def __call__(self, progress: Progress) -> None:
        if self.recorder is None and self.observe is None:
            return
        own = np.where(self.search.maximised, -1.0, 1.0)
        if self.corner is None and len(progress.front):
            worst = progress.front.max(axis=0)
            self.corner = worst + np.maximum(np.ptp(progress.front, axis=0), 0.1 * np.abs(worst)) + 1e-12
        generation = Generation(
            number=progress.generation,
            population=progress.population[np.isfinite(progress.population).all(axis=1)] * own,
            front=progress.front * own,
            front_ids=progress.ids,
            hypervolume=0.0 if self.corner is None else hypervolume(progress.front, self.corner),
            failed=progress.failed.count,
        )
        if self.recorder is not None:
            self.recorder.record(generation)
        if self.observe is not None:
            self.observe(generation, progress)


def _searched(
    search: Search,
    endings: list[Ending],
    points: int | None,
    provenance: dict[str, Any],
    watch: _Watch,
    improver: Improver | SmoothImprover | None,
) -> Front:
    started = time.monotonic()
    status = evolve(search, endings, observe=watch, improve=improver)
    if not len(search.archive):
        raise _infeasible(search)
    counts = {
        "generations": search.generation,
        "evaluations": search.evaluations,
        "iterations": 0 if improver is None else improver.spent,
        "failed": search.failed.count,
        "first_cause": search.failed.first_cause,
        "seconds": round(time.monotonic() - started, 3),
    }
    return replace(
        search.front_of(points),
        problem=search.problem,
        provenance={**provenance, "status": status, "counts": counts},
    )


def _until(interruption: Interruption, observe: Callable[[int, int], object] | None) -> Callable[[int, int], bool]:
    """Return an observer that also says when a signal came."""

    def watch(done: int, wanted: int) -> bool:
        if observe is not None:
            observe(done, wanted)
        return bool(interruption)

    return watch


def _infeasible(search: Search) -> Infeasible:
    least = search.archive.least_violating
    if least is None:
        return Infeasible(f"no feasible point in {search.evaluations} evaluations, and none without a failure")
    worst = float(least.G.max())
    names = getattr(search.problem, "constraint_names", tuple(f"constraint {i + 1}" for i in range(least.G.shape[1])))
    limit = names[int(np.argmax(least.G[0]))]
    said = (
        search.problem.explain(least.X)[0]
        if hasattr(search.problem, "explain")
        else f"{limit} is violated by {worst:.3g}"
    )
    motion = search.problem.decode(least.X)[0] if hasattr(search.problem, "decode") else None
    return Infeasible(
        f"no motion within the limits in {search.evaluations} evaluations; of the least-violating one, {said}",
        motion=motion,
        limit=limit,
        violation=worst,
    )


def _initial_genes(problem: Any, initial: Genes | Motion | Front | None) -> Genes | None:
    if isinstance(initial, Front):
        if initial.genes is not None and initial.provenance.get("fingerprint") == fingerprint(problem):
            return np.array(initial.genes)
        if initial.motions is None:
            raise InvalidInput("initial: the front is of another problem and has no motions to start from")
        initial = initial.motions  # type: ignore[assignment]  # a front of motions holds Motion
    if initial is None or isinstance(initial, np.ndarray | list):
        return initial
    if not hasattr(problem, "encode"):
        raise InvalidInput("initial: wants genes, as this problem cannot encode motions")
    genes, missed = problem.encode(initial)
    inexact = missed > EXACT
    if inexact.any():
        warnings.warn(
            f"initial: {inexact.sum()} of {len(genes)} motions start approximately; the genes miss them by up to "
            f"{missed.max():.2g} rad (or m)",
            RuntimeWarning,
            stacklevel=3,
        )
    said: Genes = genes
    return said


def _signed_target(search: Search, target: Sequence[float]) -> tuple[float, ...]:
    if len(target) != len(search.names):
        raise InvalidInput(f"target: wants {len(search.names)} numbers, one an objective, got {len(target)}")
    return tuple(-value if turned else value for value, turned in zip(target, search.maximised, strict=True))


def _recorder(folder: Path, search: Search, reference: str | None) -> Recorder:
    return Recorder(
        folder / RECORDING,
        title=reference or type(search.problem).__name__,
        names=search.names,
        units=search.units,
        maximised=search.maximised,
    )


def _review(front: Front, folder: Path, recorder: Recorder) -> None:
    from paretoik.review.plots import front_picture  # here: matplotlib takes its time

    choice: Choice = front.select(Weights(dict.fromkeys(front.names, 1.0)))
    recorder.finish(front, choice)
    front_picture(front, folder / PICTURE)
    if front.certificates is not None:
        from paretoik.review.certificate_plots import certificates_picture

        certificates_picture(front, folder / CERTIFICATES)

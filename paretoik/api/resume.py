"""Let a run go on that was stopped or killed, as if it had never been, or a finished search by more generations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.epsilon_front import epsilon_front
from paretoik.api.initial import INITIAL
from paretoik.api.load import check_problem_argument, how_to_name, named_problem
from paretoik.api.plan import plan
from paretoik.api.progress import Observer
from paretoik.api.refine import refine
from paretoik.api.session import SOURCE, StoppedRun
from paretoik.api.solve import solve
from paretoik.errors import InvalidInput, InvalidRun
from paretoik.formulations.motions import restore_motions
from paretoik.formulations.protocol import at_samples_of, timeline
from paretoik.front.front import Front
from paretoik.front.points import attach
from paretoik.front.preferences.weights import Weights
from paretoik.inputs import check_call, check_count, check_flag, check_function, file_path
from paretoik.runs.executor import check_workers
from paretoik.runs.files import CHECKPOINT, FINISHED, JOURNAL, RUN, can_resume, check_digest, read_run
from paretoik.runs.fingerprint import check_fingerprint
from paretoik.runs.folder import reclaim_folder
from paretoik.runs.interruption import check_time_limit
from paretoik.runs.journal import journalled, recalled
from paretoik.runs.machine import versions
from paretoik.search.genes import check_algorithm
from paretoik.trajectory.plan import Plan

VERBS: dict[str, Callable[..., Front | Plan]] = {each.__name__: each for each in (solve, plan, epsilon_front, refine)}
ENDINGS = {"evaluations": None, "target": None, "stagnation": False}  # settings of solve that end it; what lifts them
OF_LOOP = {"weights", "warm_start"}  # settings of a closed loop's run that are the problem's own


@check_call
def resume(
    folder: str | Path,
    problem: Any = None,
    *,
    generations: int | None = None,
    algorithm: Any = None,
    time_limit: float | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    live: bool = False,
    observe: Observer | bool | None = None,
) -> Front | Plan:
    """Let a run go on that was stopped or killed, or a finished search; return the result.

    The result is, bit for bit, that of a run that never stopped: what was computed before is in the run's journal, the
    rest is computed from it. A run that was stopped by its time limit has none unless one is given again.

    A finished search goes on for more ``generations``, from exactly where it ended. The result is that of one run of
    all these generations with the run's ``settings``, ``anchors`` among them; ``solve`` chooses these by the number of
    generations if none are given. If the run reached its target, or ended by stagnation or after some evaluations, this
    ending no longer holds.

    Parameters
    ----------
    folder
        Folder of a run of ``solve``, ``plan``, ``epsilon_front`` or ``refine``.
    problem
        Problem that the run solves, or its name, "FILE.py:NAME", whose file is run.
    generations
        Number of generations to add to a finished run of ``solve``; None for a run that was stopped.
    algorithm
        The pymoo algorithm, with the same settings, of a run of ``solve`` that was given one.
    time_limit
        Seconds of computing, as for ``solve``, after which it stops again and keeps what it has.
    workers, cluster
        As for ``solve``; they may be others than before.
    live, observe
        As for ``solve``.

    Raises
    ------
    InvalidRun
        Where the folder is no run, or has a damaged journal, or what is computed anew is not what the journal has.
    InvalidInput
        If the run is finished and no ``generations`` are given, or the other way round; if another process is at work
        on it; if ``problem`` is not at hand or another than the run's, or a library has another version than it had.
    """
    folder = file_path("folder", folder)
    check_flag("live", live)
    check_count("generations", generations)
    check_algorithm(algorithm)
    check_problem_argument(problem)
    check_time_limit(time_limit)
    check_workers(workers, cluster)
    if not isinstance(observe, bool):
        check_function("observe", observe)
    _read_resumable(folder, generations)  # what cannot go on is not locked
    with reclaim_folder(folder):
        verb, arguments = _call(folder, problem, algorithm, time_limit, generations)
        shown = {"live": live, "workers": workers, "cluster": cluster}
        if verb is not solve:
            del shown["live"]
        if generations is not None:  # from now on it is a run that was stopped
            (folder / CHECKPOINT / FINISHED).replace(folder / CHECKPOINT / JOURNAL)
        with journalled(folder / CHECKPOINT / JOURNAL):
            if arguments.pop("initial", False) and recalled(INITIAL) is None:
                raise InvalidRun(
                    f"{folder}: wanted what the run started from in its journal, got none, so that it would come to "
                    "another result; start it again"
                )
            return verb(**arguments, **shown, out=StoppedRun(folder), time_limit=time_limit, observe=observe)


def _call(
    folder: Path, problem: Any, algorithm: Any, time_limit: float | None, generations: int | None
) -> tuple[Callable[..., Front | Plan], dict[str, Any]]:
    """Return the verb that a run began with, and its arguments; raises as ``resume`` does."""
    run = _read_resumable(folder, generations)
    _check_versions(folder, run)
    problem = named_problem(problem, time_limit=time_limit)
    if problem is None:
        how = how_to_name(run.get("problem"))
        raise InvalidInput(f"{folder}: the problem wanted that the run solves, got none; {how}")
    check_fingerprint(problem, run.get("fingerprint"), wish=f"{folder}: wants the problem that the run solves")
    verb, settings = VERBS.get(str(run.get("verb"))), run.get("settings")
    if verb is None:
        raise InvalidRun(f"{folder}: wanted a run of solve, plan, front or refine, got one of {run.get('verb')!r}")
    is_loop = timeline(problem) == "step"
    names = {*signature(verb).parameters} | (OF_LOOP if is_loop else set())
    if not (isinstance(settings, dict) and settings.keys() <= names):
        raise InvalidRun(f"{folder}: wanted the settings of {run['verb']}, got {settings!r:.200}")
    if generations is not None:
        settings = _longer(folder, run, settings, generations)
    arguments = {"problem": problem, "reference": run.get("problem"), **settings}
    arguments.pop("time_limit", None)
    if verb is refine:
        arguments["front"] = _source(folder, problem)
    elif verb is solve and is_loop:
        arguments = _loop_arguments(arguments)
    elif verb is solve:
        arguments |= _search_arguments(settings, algorithm)
    return verb, arguments


def _read_resumable(folder: Path, generations: int | None) -> dict[str, Any]:
    """Return the entries of a run that can go on; raises InvalidRun for no run, InvalidInput for another one."""
    run = read_run(folder / RUN)
    check_digest(folder / RUN, run)
    verb, status, checkpoint = run.get("verb"), run.get("status"), folder / CHECKPOINT
    is_finished = (checkpoint / FINISHED).is_file() and not checkpoint.is_symlink()
    if generations is not None and not is_finished:
        fact = f"a run of {verb} of status {status!r} that keeps no generations"
        raise InvalidInput(f"generations: must be None but for a finished search by solve, got {fact}")
    if generations is None and not can_resume(folder):
        how = "; generations=, or --generations, continues it" if is_finished else " with nothing to go on from"
        raise InvalidInput(
            f"{folder}: wanted a run of solve, plan, front or refine that was stopped, got one of status "
            f"{status!r}{how}"
        )
    return run


def _longer(folder: Path, run: Mapping[str, Any], settings: Mapping[str, Any], generations: int) -> dict[str, Any]:
    """Return the settings of a finished search with more generations, without the ending that it reached."""
    ended = {name: ENDINGS[name] for name in ENDINGS if name == run.get("status")}
    try:
        return {**settings, **ended, "generations": int(run["counts"]["generations"]) + generations}
    except (KeyError, TypeError, ValueError) as fault:
        raise InvalidRun(f"{folder}: wanted the number of its generations, got {run.get('counts')!r:.200}") from fault


def _search_arguments(settings: Mapping[str, Any], algorithm: Any) -> dict[str, Any]:
    """Return an algorithm and a target as ``solve`` takes them; raises InvalidInput for another kind of algorithm."""
    kind, before = None if algorithm is None else type(algorithm).__name__, settings.get("algorithm")
    if kind != before:
        raise InvalidInput(f"algorithm: {before or 'none'} wanted, as the run has it, got {kind or 'none'}")
    target = settings.get("target")
    return {"algorithm": algorithm, "target": None if target is None else [float(value) for value in target]}


def _loop_arguments(arguments: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of ``solve`` for a closed loop with the weights that its run had."""
    loop, weights = arguments["problem"], arguments["weights"]
    if not np.array_equal(list(weights.values()), loop.weights):
        loop = loop.changed(weights=Weights(weights))
    return {name: value for name, value in arguments.items() if name not in OF_LOOP} | {"problem": loop}


def _source(folder: Path, problem: Any) -> Front:
    """Return the front that a run of ``refine`` began with, in the folder that it had then."""
    front = Front.load(folder.joinpath(*SOURCE))
    provenance = dict(front.provenance)
    run = provenance.pop("run", None)
    problem = at_samples_of(problem, getattr(front.motions, "q", None))
    front = replace(front, motions=restore_motions(problem, front), problem=problem, provenance=provenance)
    return front if run is None else attach(front, Path(run))


def _check_versions(folder: Path, run: Mapping[str, Any]) -> None:
    """Raise InvalidInput where a package has another version than a run had."""
    before = run.get("versions")
    if not isinstance(before, Mapping):
        raise InvalidRun(f"{folder}: wanted the versions that the run was made by, got {before!r:.200}")
    for name, now in versions().items():
        if before.get(name) != now:
            raise InvalidInput(f"{folder}: wanted {name} {before.get(name)}, as the run has it, got {now}")

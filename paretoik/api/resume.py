"""Resume a stopped or killed run, or continue a finished search."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.epsilon_front import epsilon_front
from paretoik.api.initial import INITIAL
from paretoik.api.load import how_to_name, named_problem
from paretoik.api.plan import plan
from paretoik.api.refine import refine
from paretoik.api.session import SOURCE, StoppedRun
from paretoik.api.solve import solve
from paretoik.errors import InvalidInput, InvalidRun
from paretoik.formulations.motions import restore_motions
from paretoik.formulations.protocol import at_samples_of, timeline
from paretoik.front.front import Front
from paretoik.front.points import attach
from paretoik.front.preferences.weights import Weights
from paretoik.inputs import check_count, check_flag, check_function, file_path
from paretoik.progress import Observer
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
ENDINGS = {"evaluations": None, "target": None, "stagnation": False}  # values that disable endings of ``solve``
OF_LOOP = {"weights", "warm_start"}  # settings of a closed loop's run that belong to the problem


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
    """Resume a stopped or killed run, or continue a finished search.

    Parameters
    ----------
    folder
        Folder of a run of ``solve``, ``plan``, ``epsilon_front`` or ``refine``.
    problem
        Problem that the run solves, or its name, "FILE.py:NAME", whose file is run.
    generations
        Number of generations to add to a finished run of ``solve``; None (default) for a stopped run.
    algorithm
        Algorithm of pymoo, with the same settings, if the run of ``solve`` was given one.
    time_limit
        Computing time [s], as for ``solve``, after which the run stops again (default: no limit, even if it had one).
    workers
        Number of processes, as for ``solve``; may differ from before.
    cluster
        Address of a Dask scheduler in place of ``workers``, as for ``solve``; may differ from before.
    live
        Whether to open a viewer on the recording, as for ``solve`` (default False).
    observe
        Observer of progress, as for ``solve``.

    Returns
    -------
    Front or Plan
        Result, bit for bit that of a run that never stopped.

    Raises
    ------
    InvalidRun
        If the folder contains no run, its journal is damaged, or results computed again differ from the journal.
    InvalidInput
        If ``generations`` is missing for a finished run or given for a stopped one, ``problem`` is missing or not
        the run's, another process works on the run, or a library has another version than before.

    Notes
    -----
    Values computed before come from the run's journal; only the rest is computed.

    A finished search continues exactly where it ended. The result is that of one run of all these generations with the
    run's ``settings``. Its ``anchors`` stay the same, although ``solve`` would choose more of them for more
    generations. An ending that the run reached (target, stagnation or evaluations) no longer applies.
    """
    folder = file_path("folder", folder)
    check_flag("live", live)
    check_count("generations", generations)
    check_algorithm(algorithm)
    check_time_limit(time_limit)
    check_workers(workers, cluster)
    if not isinstance(observe, bool):
        check_function("observe", observe)
    _read_resumable(folder, generations)  # a run that cannot be resumed is not locked
    with reclaim_folder(folder):
        run = _read_resumable(folder, generations)
        before = run.get("versions")
        if not isinstance(before, Mapping):
            raise InvalidRun(f"{folder} must have the versions that made the run, got {before!r:.200}")
        for name, now in versions().items():
            if before.get(name) != now:
                raise InvalidInput(f"{name} must be {before.get(name)}, as in the run {folder}, got {now}")
        problem, wish = named_problem(problem, time_limit=time_limit), f"the one that the run in {folder} solves"
        if problem is None:
            raise InvalidInput(f"problem must be {wish}, got none; {how_to_name(run.get('problem'))}")
        check_fingerprint(problem, run.get("fingerprint"), wish=f"problem must be {wish}")
        verb, arguments = _call(folder, run, problem, algorithm, generations)
        shown = {"live": live} if verb is solve else {}
        if generations is not None:  # from now on this is a stopped run
            (folder / CHECKPOINT / FINISHED).replace(folder / CHECKPOINT / JOURNAL)
        with journalled(folder / CHECKPOINT / JOURNAL):
            if arguments.pop("initial", False) and recalled(INITIAL) is None:
                raise InvalidRun(
                    f"{folder} must have the initial solutions in its journal, got none: the result would change; "
                    "start the run again"
                )
            return verb(
                **arguments,
                **shown,
                workers=workers,
                cluster=cluster,
                out=StoppedRun(folder),
                time_limit=time_limit,
                observe=observe,
            )


def _read_resumable(folder: Path, generations: int | None) -> dict[str, Any]:
    """Return the entries of a resumable run; raises InvalidRun or InvalidInput for other folders."""
    run = read_run(folder / RUN)
    check_digest(folder / RUN, run)
    verb, status, checkpoint = run.get("verb"), run.get("status"), folder / CHECKPOINT
    is_finished = (checkpoint / FINISHED).is_file() and not checkpoint.is_symlink()
    if generations is not None and not is_finished:
        fact = f"a run of {verb} of status {status!r} that keeps no generations"
        raise InvalidInput(f"generations must be None except for a finished search of solve, got {fact}")
    if generations is None and not can_resume(folder):
        how = "; generations=, or --generations, continues it" if is_finished else " that cannot be resumed"
        raise InvalidInput(
            f"{folder} must be a stopped run of solve, plan, front or refine, got one of status {status!r}{how}"
        )
    return run


def _call(
    folder: Path, run: Mapping[str, Any], problem: Any, algorithm: Any, generations: int | None
) -> tuple[Callable[..., Front | Plan], dict[str, Any]]:
    """Return the verb of a run, and its arguments. Raises as ``resume`` does."""
    verb, settings = VERBS.get(str(run.get("verb"))), run.get("settings")
    if verb is None:
        raise InvalidRun(f"{folder} must be a run of solve, plan, front or refine, got one of {run.get('verb')!r}")
    is_loop = timeline(problem) == "step"
    names = {*signature(verb).parameters} | (OF_LOOP if is_loop else set())
    if not (isinstance(settings, dict) and settings.keys() <= names):
        raise InvalidRun(f"{folder} must have the settings of {run['verb']}, got {settings!r:.200}")
    arguments = {"problem": problem, "reference": run.get("problem"), **settings}
    arguments.pop("time_limit", None)
    if generations is not None:  # disable the ending that the run reached
        ended = {name: ENDINGS[name] for name in ENDINGS if name == run.get("status")}
        counts = run.get("counts")
        if not isinstance(counts, Mapping) or not isinstance(counts.get("generations"), int):
            raise InvalidRun(f"{folder} must contain the number of generations done, got counts {counts!r:.200}")
        arguments |= {**ended, "generations": counts["generations"] + generations}
    if verb is refine:  # start from the run's first front, with its former folder
        front = Front.load(folder.joinpath(*SOURCE))
        provenance = dict(front.provenance)
        former = provenance.pop("run", None)
        finer = at_samples_of(problem, getattr(front.motions, "q", None))
        front = replace(front, motions=restore_motions(finer, front), problem=finer, provenance=provenance)
        arguments["front"] = front if former is None else attach(front, Path(former))
    elif verb is solve and is_loop:  # use the weights of the run
        weights = arguments["weights"]
        if not np.array_equal(list(weights.values()), problem.weights):
            arguments["problem"] = problem.changed(weights=Weights(weights))
        arguments = {name: value for name, value in arguments.items() if name not in OF_LOOP}
    elif verb is solve:
        kind, before = None if algorithm is None else type(algorithm).__name__, settings.get("algorithm")
        if kind != before:
            raise InvalidInput(f"algorithm must be {before or 'none'}, as in the run, got {kind or 'none'}")
        target = arguments.get("target")  # an infinite number is stored as text
        arguments |= {"algorithm": algorithm, "target": None if target is None else [float(each) for each in target]}
    return verb, arguments

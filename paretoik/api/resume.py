"""Let a run go on that was stopped or killed, as if it had never been."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.epsilon_front import epsilon_front
from paretoik.api.plan import plan
from paretoik.api.progress import Observer
from paretoik.api.refine import refine
from paretoik.api.run_problem import problem_of_run
from paretoik.api.run_session import SOURCE, StoppedRun, versions
from paretoik.api.solve import solve
from paretoik.errors import InvalidInput, InvalidRun
from paretoik.execution.run_folder import reclaim_folder
from paretoik.fingerprint.fingerprint import check_fingerprint
from paretoik.formulations.protocol import restore_motions, timeline
from paretoik.front.front import Front
from paretoik.front.preferences.weights import Weights
from paretoik.front.subset import attach
from paretoik.inputs import file_path
from paretoik.journal import journalled
from paretoik.run_files import CHECKPOINT, JOURNAL, RUN, can_resume, read_run
from paretoik.trajectory.plan import Plan

LOOP_SETTINGS = ("population", "generations", "seed", "record_steps")  # of a closed loop, that solve takes


def resume(
    folder: str | Path,
    problem: Any = None,
    *,
    algorithm: Any = None,
    time_limit: float | None = None,
    live: bool = False,
    observe: Observer | bool | None = None,
) -> Front | Plan:
    """Let a run go on that was stopped, by a signal or its time limit, or killed; return what it comes to.

    The result is, bit for bit, that of a run that never stopped: what was computed before is in the run's journal, the
    rest is computed from it. A run that was stopped by its time limit has none unless one is given anew.

    Parameters
    ----------
    folder
        Folder of a run of ``solve``, ``plan``, ``epsilon_front`` or ``refine``.
    problem
        What the run solves, or its name, "FILE.py:NAME"; by default what the run names, as ``load_front`` has it.
    algorithm
        The pymoo algorithm, with the same settings, of a run of ``solve`` that was given one.
    time_limit
        Seconds after which it stops again and keeps what it has.
    live, observe
        As for ``solve``.

    Raises
    ------
    InvalidRun
        Where the folder is no run, or has a damaged journal, or what is computed anew is not what the journal has.
    InvalidInput
        Where the run is finished, or another process is at work on it; where ``problem`` is not at hand or another
        than the run's, or a library has another version than it had.
    """
    folder = file_path("folder", folder)
    read_run(folder / RUN)  # what is no run is not locked
    with reclaim_folder(folder):
        verb, arguments = _call(folder, problem, algorithm)
        shown = {"live": live} if verb is solve else {}
        with journalled(folder / CHECKPOINT / JOURNAL):
            return verb(**arguments, **shown, out=StoppedRun(folder), time_limit=time_limit, observe=observe)


def _call(folder: Path, problem: Any, algorithm: Any) -> tuple[Callable[..., Front | Plan], dict[str, Any]]:
    """Return the verb that a run began with, and its arguments; raises as ``resume`` does."""
    run = read_run(folder / RUN)
    if not can_resume(folder):
        raise InvalidInput(
            f"{folder}: wanted a run of solve, plan, front or refine that was stopped, got one of status "
            f"{run.get('status')!r} with nothing to go on from"
        )
    _check_versions(folder, run)
    problem = problem_of_run(folder, run.get("problem"), problem)
    if problem is None:
        raise InvalidInput(f"{folder}: the problem wanted that the run solves; resume(folder, problem) names it")
    check_fingerprint(problem, run.get("fingerprint"), wish=f"{folder}: wants the problem that the run solves")
    arguments = {"problem": problem, "reference": run.get("problem"), **run["settings"]}
    del arguments["time_limit"]
    match run.get("verb"):
        case "solve" if timeline(problem) == "step":
            return solve, _loop_arguments(arguments)
        case "solve":
            name, given = arguments.pop("algorithm"), None if algorithm is None else type(algorithm).__name__
            if name != given:
                raise InvalidInput(f"algorithm: {name or 'none'} wanted, as the run has it, got {given or 'none'}")
            if arguments["target"] is not None:
                arguments["target"] = [float(value) for value in arguments["target"]]
            return solve, arguments | {"algorithm": algorithm}
        case "plan":
            return plan, arguments
        case "epsilon_front":
            return epsilon_front, arguments
        case "refine":
            return refine, arguments | {"front": _source(folder, problem)}
    raise InvalidRun(f"{folder}: wanted a run of solve, plan, front or refine, got one of {run.get('verb')!r}")


def _loop_arguments(arguments: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of ``solve`` for a closed loop with the weights that its run had."""
    loop, weights = arguments["problem"], arguments["weights"]
    if not np.array_equal(list(weights.values()), loop.weights):
        loop = loop.changed(weights=Weights(weights))
    return {name: arguments[name] for name in ("reference", *LOOP_SETTINGS)} | {"problem": loop}


def _source(folder: Path, problem: Any) -> Front:
    """Return the front that a run of ``refine`` began with, in the folder that it had then."""
    front = Front.load(folder / SOURCE)
    provenance = dict(front.provenance)
    run = provenance.pop("run", None)
    front = replace(front, motions=restore_motions(problem, front), problem=problem, provenance=provenance)
    return front if run is None else attach(front, Path(run))


def _check_versions(folder: Path, run: Mapping[str, Any]) -> None:
    """Raise InvalidInput where a package has another version than a run had."""
    before, now = run.get("versions", {}), versions()
    for name in now:
        if before.get(name) != now[name]:
            raise InvalidInput(f"{folder}: wanted {name} {before.get(name)}, as the run has it, got {now[name]}")

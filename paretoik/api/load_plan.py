"""Open the plan of a run again."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from paretoik.api.plan_storage import read_plan
from paretoik.api.run_problem import check_problem_argument, how_to_name, named_problem
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput, InvalidRun
from paretoik.fingerprint.fingerprint import check_fingerprint
from paretoik.formulations.protocol import at_samples_of
from paretoik.formulations.stored_motions import motions_of_task
from paretoik.inputs import file_path
from paretoik.run_files import MOTIONS
from paretoik.trajectory.plan import Optimum, Plan


@check_call
def load_plan(folder: str | Path, problem: Any = None) -> Plan:
    """Return the plan of a run folder, its motions with the arm of ``problem``.

    ``problem`` is the problem or its name, "FILE.py:NAME", whose file is run; it is always needed.

    Raises
    ------
    InvalidRun
        If the folder is no run of ``plan``, or damaged, or its motions are not on the path of the problem.
    InvalidInput
        If no problem is given, or another one than was planned.
    """
    folder = file_path("folder", folder)
    check_problem_argument(problem)
    run, columns, stored = read_plan(folder)
    problem = named_problem(problem)
    if problem is None:
        how = how_to_name(run.get("problem"))
        raise InvalidInput(f"{folder}: the problem wanted that was planned, got none; {how}")
    check_fingerprint(problem, run.get("fingerprint"), wish=f"{folder}: wants the problem that was planned")
    problem = at_samples_of(problem, stored.q)
    try:
        motions = motions_of_task(problem, stored, columns["id"])
    except InvalidRun as fault:
        raise InvalidRun(f"{folder / MOTIONS}: {fault}") from None
    if motions is None:
        raise InvalidRun(f"{folder}: wanted motions at the samples of the problem, got others")
    return Plan(
        optima=tuple(
            Optimum(
                motion=motion,
                objective=value,
                label=branch,
                status=status,
                violation_between=violation,
                criticality=criticality,
                discretisation_error=error,
            )
            for motion, value, branch, status, violation, criticality, error in zip(
                motions,
                columns["objective"],
                columns["branch"],
                columns["status"],
                columns["violation_between"],
                columns["criticality"],
                columns["discretisation_error"],
                strict=True,
            )
        ),
        starts=_starts(run),
        levels=tuple((int(samples), int(optima)) for samples, optima in run["levels"]),
        provenance={
            key: value for key, value in run.items() if key not in ("format", "holds", "objective", "levels", "files")
        },
    )


def _starts(run: Mapping[str, Any]) -> int:
    """Return the number of starts that a run says its plan had."""
    counts = run.get("counts")
    starts = counts.get("starts") if isinstance(counts, Mapping) else None
    return starts if isinstance(starts, int) else 0

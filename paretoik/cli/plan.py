"""``paretoik plan``: the distinct optima of a problem with one objective."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

import typer

from paretoik.api.result_text import optima_entries, plan_text, resume_command
from paretoik.cli.console import (
    ClusterAddress,
    JsonFlag,
    OutFolder,
    Overwrite,
    Problem,
    QuietFlag,
    Seed,
    SolverOption,
    Starts,
    TimeLimit,
    Workers,
    exit_code,
    print_json,
    print_text,
    running,
)
from paretoik.trajectory.plan import Plan


def plan(
    problem: Problem,
    out: OutFolder,
    starts: Starts = None,
    seed: Seed = 0,
    solver: SolverOption = "auto",
    time_limit: TimeLimit = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    overwrite: Overwrite = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Find the distinct optima of one objective.

    Ctrl-C ends it early and keeps the result.
    """
    with running(out, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.load import named_problem
        from paretoik.api.plan import plan as find_plan

        loaded = named_problem(problem, time_limit=time_limit)
        result = find_plan(
            loaded,
            starts=starts,
            seed=seed,
            solver=solver,
            out=out,
            time_limit=time_limit,
            workers=workers,
            cluster=cluster,
            overwrite=overwrite,
            reference=problem,
            observe=observe,
        )
    finish_plan(result, loaded.names[0], loaded.units[0], out, as_json=as_json)


def finish_plan(plan: Plan, name: str, unit: str, out: Path, *, as_json: bool) -> NoReturn:
    """Print the plan of an objective that ended, as text or JSON, and exit with the code of what ended it."""
    if as_json:
        resume = resume_command(out, plan.provenance["status"])
        print_json({**plan.provenance, "out": out, "resume": resume, "optima": optima_entries(plan)})
    else:
        print_text(plan_text(plan, name, unit, out))
    raise typer.Exit(exit_code(plan.provenance["status"]))

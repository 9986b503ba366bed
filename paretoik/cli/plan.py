"""``paretoik plan``: the distinct optima of a problem with one objective."""

from __future__ import annotations

import typer

from paretoik.api.progress_display import open_observer
from paretoik.api.run_text import optima_entries, plan_text
from paretoik.cli.console import JsonFlag, QuietFlag, exit_code, print_json, stdout_for_results
from paretoik.cli.options import OutFolder, Overwrite, Problem, Seed, SolverOption, Starts, TimeLimit


def plan(
    problem: Problem,
    out: OutFolder,
    starts: Starts = None,
    seed: Seed = 0,
    solver: SolverOption = "auto",
    time_limit: TimeLimit = None,
    overwrite: Overwrite = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Find the distinct optima of one objective.

    Ctrl-C ends it early and keeps the result.
    """
    with stdout_for_results(), open_observer(not quiet, time_limit=time_limit) as observe:
        from paretoik.api.plan import plan as find_plan
        from paretoik.loading import load_problem

        loaded = load_problem(problem)
        result = find_plan(
            loaded,
            starts=starts,
            seed=seed,
            solver=solver,
            out=out,
            time_limit=time_limit,
            overwrite=overwrite,
            reference=problem,
            observe=observe or False,
        )
    if as_json:
        print_json({**result.provenance, "out": out, "optima": optima_entries(result)})
    else:
        print(plan_text(result, loaded.names[0], loaded.units[0], out))
    raise typer.Exit(exit_code(result.provenance["status"]))

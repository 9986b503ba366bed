"""The commands that make a run.

These are ``paretoik solve``, ``plan``, ``front``, ``refine`` and ``resume``. An option that is also an argument of the
verb in ``paretoik.api`` has the same name, and is passed on.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from paretoik.cli.console import (
    ClusterAddress,
    JsonFlag,
    Live,
    OutFolder,
    Overwrite,
    Problem,
    QuietFlag,
    RunFolder,
    RunProblem,
    Seed,
    SolverName,
    SolverOption,
    Starts,
    TimeLimit,
    Workers,
    agreed_problem,
    finish_front,
    finish_plan,
    running,
)
from paretoik.errors import InvalidInput
from paretoik.front.front import Front
from paretoik.runs.files import RUN, read_run

OF_COMMAND = ("problem", "run", "quiet", "as_json")  # options that are not arguments of the verb


def arguments(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that a verb takes unchanged."""
    return {name: value for name, value in options.items() if name not in OF_COMMAND}


def solve(
    problem: Problem,
    out: OutFolder,
    population: Annotated[
        int | None, typer.Option(help="Size of the population (200; for a closed loop its own).")
    ] = None,
    generations: Annotated[int | None, typer.Option(help="Most generations (500; for a closed loop its own).")] = None,
    points: Annotated[int, typer.Option(help="Most points of the front, spread over it.")] = 200,
    seed: Annotated[int | None, typer.Option(help="Seed of all random numbers (0).")] = None,
    islands: Annotated[int, typer.Option(help="Populations; some of the best migrate to the next one.")] = 1,
    time_limit: TimeLimit = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    evaluation_timeout: Annotated[
        float | None, typer.Option(help="Seconds after which an evaluation is ended and has failed.")
    ] = None,
    refine: Annotated[bool, typer.Option("--refine", help="Use gradients, and add optima and certificates.")] = False,
    solver: Annotated[
        SolverName,
        typer.Option(help="Solver of --refine: interior points (smooth functions), or SQP by Clarabel (any)."),
    ] = "auto",
    record_steps: Annotated[
        list[int] | None,
        typer.Option("--record-step", help="Step of a closed loop whose generations are recorded; may be repeated."),
    ] = None,
    live: Live = False,
    overwrite: Overwrite = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Search for the front of a problem, or follow a closed loop.

    Ctrl-C ends it early and keeps the result.
    """
    given = {**arguments(locals()), "record_steps": record_steps or ()}
    with running(out, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.load import named_problem
        from paretoik.api.solve import solve as solve_problem

        loaded = named_problem(problem, time_limit=time_limit, evaluation_timeout=evaluation_timeout)
        result = solve_problem(loaded, **given, reference=problem, observe=observe)
    finish_front(result, out, as_json=as_json)


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
    given = arguments(locals())
    with running(out, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.load import named_problem
        from paretoik.api.plan import plan as find_plan

        loaded = named_problem(problem, time_limit=time_limit)
        result = find_plan(loaded, **given, reference=problem, observe=observe)
    finish_plan(result, loaded.names[0], loaded.units[0], out, as_json=as_json)


def front(
    problem: Problem,
    out: OutFolder,
    points: Annotated[int, typer.Option(help="Most points of the front, spread over it.")] = 20,
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
    """Find a certified front by gradients only.

    One objective is minimised, the others are bounded by one ε after another.
    Ctrl-C ends it early and keeps the result.
    """
    given = arguments(locals())
    with running(out, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.epsilon_front import epsilon_front
        from paretoik.api.load import named_problem

        loaded = named_problem(problem, time_limit=time_limit)
        result = epsilon_front(loaded, **given, reference=problem, observe=observe)
    finish_front(result, out, as_json=as_json)


def refine(
    run: RunFolder,
    out: OutFolder,
    problem: RunProblem = None,
    solver: SolverOption = "auto",
    time_limit: TimeLimit = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    overwrite: Overwrite = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Refine and certify the front of a run, as a new run.

    No certified point becomes worse in any objective. Other points may become worse by about 1e-4 of a range if limits
    between samples require it. Ctrl-C ends it early and keeps the result.
    """
    given = arguments(locals())
    with running(out, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.load import load_front
        from paretoik.api.refine import refine as refine_front

        problem = agreed_problem(run, problem, needed=True)
        loaded = load_front(run, problem)
        if problem is None:
            raise InvalidInput(
                f"{run} must be a run that names its problem, got one made without reference=; --problem FILE.py:NAME "
                "names it, or in Python paretoik.refine(load_front(run), problem)"
            )
        result = refine_front(loaded, **given, observe=observe)
    finish_front(result, out, as_json=as_json)


def resume(
    run: RunFolder,
    problem: RunProblem = None,
    generations: Annotated[int | None, typer.Option(help="Generations to add to a finished search.")] = None,
    time_limit: TimeLimit = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    live: Live = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Resume a stopped or killed run, or continue a finished search.

    The result is that of a run that never stopped.
    """
    given = arguments(locals())
    with running(run, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.resume import resume as resume_run

        result = resume_run(run, agreed_problem(run, problem, needed=True), **given, observe=observe)
    if isinstance(result, Front):
        finish_front(result, run, as_json=as_json)
    objective = read_run(run / RUN)["objective"]
    finish_plan(result, objective["name"], objective["unit"], run, as_json=as_json)

"""``paretoik solve``: search for the front of a problem, or follow a closed loop."""

from __future__ import annotations

from typing import Annotated

import typer

from paretoik.cli.console import (
    ClusterAddress,
    JsonFlag,
    Live,
    OutFolder,
    Overwrite,
    Problem,
    QuietFlag,
    SolverName,
    TimeLimit,
    Workers,
    finish_front,
    running,
)


def solve(
    problem: Problem,
    out: OutFolder,
    population: Annotated[
        int | None, typer.Option(help="Size of the population (200; for a closed loop its own).", show_default=False)
    ] = None,
    generations: Annotated[
        int | None, typer.Option(help="Most generations (500; for a closed loop its own).", show_default=False)
    ] = None,
    points: Annotated[int, typer.Option(help="Most points of the front, spread over it.")] = 200,
    seed: Annotated[int | None, typer.Option(help="Seed of all random numbers (0).", show_default=False)] = None,
    islands: Annotated[int, typer.Option(help="Populations; some of the best migrate to the next one.")] = 1,
    time_limit: TimeLimit = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    evaluation_timeout: Annotated[
        float | None,
        typer.Option(help="Seconds after which an evaluation is ended and has failed.", show_default=False),
    ] = None,
    refine: Annotated[bool, typer.Option("--refine", help="Use gradients, and add optima and certificates.")] = False,
    solver: Annotated[
        SolverName,
        typer.Option(help="Solver of --refine: interior points (smooth functions), or SQP by Clarabel (any)."),
    ] = "auto",
    record_step: Annotated[
        list[int] | None,
        typer.Option(help="Step of a closed loop whose generations are recorded; may be repeated.", show_default=False),
    ] = None,
    live: Live = False,
    overwrite: Overwrite = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Search for the front of a problem, or follow a closed loop.

    Ctrl-C ends it early and keeps the result.
    """
    with running(out, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.load import named_problem
        from paretoik.api.solve import solve as solve_problem

        front = solve_problem(
            named_problem(problem, time_limit=time_limit, evaluation_timeout=evaluation_timeout),
            population=population,
            generations=generations,
            points=points,
            seed=seed,
            islands=islands,
            out=out,
            time_limit=time_limit,
            workers=workers,
            cluster=cluster,
            evaluation_timeout=evaluation_timeout,
            refine=refine,
            solver=solver,
            overwrite=overwrite,
            record_steps=record_step or (),
            live=live,
            reference=problem,
            observe=observe,
        )
    finish_front(front, out, as_json=as_json)

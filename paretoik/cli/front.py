"""``paretoik front``: a certified front by ε-constraints."""

from __future__ import annotations

from typing import Annotated

import typer

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
    finish_front,
    running,
)


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
    with running(out, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.epsilon_front import epsilon_front
        from paretoik.api.load import named_problem

        result = epsilon_front(
            named_problem(problem, time_limit=time_limit),
            points=points,
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
    finish_front(result, out, as_json=as_json)

"""``paretoik resume``: resume a stopped or killed run, or continue a finished search."""

from __future__ import annotations

from typing import Annotated

import typer

from paretoik.cli.console import (
    ClusterAddress,
    JsonFlag,
    Live,
    QuietFlag,
    RunFolder,
    RunProblem,
    TimeLimit,
    Workers,
    agreed_problem,
    finish_front,
    running,
)
from paretoik.cli.plan import finish_plan
from paretoik.front.front import Front
from paretoik.runs.files import RUN, read_run


def resume(
    run: RunFolder,
    problem: RunProblem = None,
    generations: Annotated[
        int | None, typer.Option(help="Generations to add to a finished search.", show_default=False)
    ] = None,
    time_limit: TimeLimit = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    live: Live = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Resume a run that was stopped or killed, or continue a finished search by more generations.

    The result is that of a run that never stopped.
    """
    with running(run, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.resume import resume as resume_run

        result = resume_run(
            run,
            agreed_problem(run, problem, needed=True),
            generations=generations,
            time_limit=time_limit,
            workers=workers,
            cluster=cluster,
            live=live,
            observe=observe,
        )
    if isinstance(result, Front):
        finish_front(result, run, as_json=as_json)
    objective = read_run(run / RUN)["objective"]
    finish_plan(result, objective["name"], objective["unit"], run, as_json=as_json)

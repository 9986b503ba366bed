"""``paretoik resume``: resume a stopped or killed run, or continue a finished search."""

from __future__ import annotations

from typing import Annotated

import typer

from paretoik.api.progress import open_observer
from paretoik.cli.console import (
    ClusterAddress,
    JsonFlag,
    QuietFlag,
    RunFolder,
    RunProblem,
    TimeLimit,
    Workers,
    agreed_problem,
    finish_front,
    says_how_to_go_on,
    stdout_for_results,
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
    live: Annotated[
        bool, typer.Option("--live", help="Open a viewer on the run; without a screen, say how to attach one.")
    ] = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Resume a run that was stopped or killed, or continue a finished search by more generations.

    The result is that of a run that never stopped.
    """
    with (
        stdout_for_results(),
        says_how_to_go_on(run, time_limit),
        open_observer(not quiet, time_limit=time_limit) as observe,
    ):
        from paretoik.api.resume import resume as resume_run

        result = resume_run(
            run,
            agreed_problem(run, problem, needed=True),
            generations=generations,
            time_limit=time_limit,
            workers=workers,
            cluster=cluster,
            live=live,
            observe=observe or False,
        )
    if isinstance(result, Front):
        finish_front(result, run, as_json=as_json)
    objective = read_run(run / RUN)["objective"]
    finish_plan(result, objective["name"], objective["unit"], run, as_json=as_json)

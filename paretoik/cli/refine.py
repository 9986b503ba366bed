"""``paretoik refine``: the front of a run, refined and certified, as a run of its own."""

from __future__ import annotations

from pathlib import Path

from paretoik.api.progress import open_observer
from paretoik.cli.console import (
    ClusterAddress,
    JsonFlag,
    OutFolder,
    Overwrite,
    QuietFlag,
    RunFolder,
    RunProblem,
    SolverOption,
    TimeLimit,
    Workers,
    agreed_problem,
    finish_front,
    says_how_to_go_on,
    stdout_for_results,
)
from paretoik.errors import InvalidInput
from paretoik.front.front import Front


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

    No point becomes worse in any objective, except by some 1e-4 of a range if limits between samples require it; no
    certified point does. Ctrl-C ends it early and keeps the result.
    """
    with (
        stdout_for_results(),
        says_how_to_go_on(out, time_limit),
        open_observer(not quiet, time_limit=time_limit) as observe,
    ):
        from paretoik.api.refine import refine as refine_front

        result = refine_front(
            _open(run, agreed_problem(run, problem, needed=True)),
            solver=solver,
            out=out,
            time_limit=time_limit,
            workers=workers,
            cluster=cluster,
            overwrite=overwrite,
            observe=observe or False,
        )
    finish_front(result, out, as_json=as_json)


def _open(run: Path, problem: str | None) -> Front:
    """Return the front of a run with its problem; raises InvalidInput without one."""
    from paretoik.api.load import load_front

    front = load_front(run, problem)
    if problem is None:
        raise InvalidInput(
            f"{run} must be a run that names its problem, got one made without reference=; --problem FILE.py:NAME "
            "names it, or in Python paretoik.refine(load_front(run), problem)"
        )
    return front

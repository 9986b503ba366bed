"""``paretoik refine``: the front of a run, refined and certified, as a run of its own."""

from __future__ import annotations

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
    running,
)
from paretoik.errors import InvalidInput


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
        result = refine_front(
            loaded,
            solver=solver,
            out=out,
            time_limit=time_limit,
            workers=workers,
            cluster=cluster,
            overwrite=overwrite,
            observe=observe,
        )
    finish_front(result, out, as_json=as_json)

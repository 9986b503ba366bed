"""``paretoik refine``: the front of a run, refined and certified, as a run of its own."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path

from paretoik.api.progress_display import open_observer
from paretoik.cli.console import JsonFlag, QuietFlag, RunFolder, finish_front
from paretoik.cli.options import OutFolder, Overwrite, SolverOption, TimeLimit
from paretoik.errors import InvalidInput
from paretoik.front.front import Front


def refine(
    run: RunFolder,
    out: OutFolder,
    solver: SolverOption = "auto",
    time_limit: TimeLimit = None,
    overwrite: Overwrite = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Refine and certify the front of a run, as a new run.

    No point becomes worse in any objective. Ctrl-C ends it early and keeps the result.
    """
    # A user's functions may print, and stdout is for the result.
    with redirect_stdout(sys.stderr), open_observer(not quiet, time_limit=time_limit) as observe:
        from paretoik.api.refine import refine as refine_front

        result = refine_front(
            _open(run),
            solver=solver,
            out=out,
            time_limit=time_limit,
            overwrite=overwrite,
            observe=observe or False,
        )
    finish_front(result, out, as_json=as_json)


def _open(run: Path) -> Front:
    """Return the front of a run with its problem; raises InvalidInput where that cannot be had."""
    from paretoik.api.load_front import load_front
    from paretoik.loading import load_problem

    reference = Front.load(run).provenance.get("problem")
    if reference is None:
        raise InvalidInput(
            f"{run}: wants a run that names its problem, got one made without reference=; refine it in Python by "
            "paretoik.refine(load_front(run), problem)"
        )
    return load_front(run, load_problem(str(reference)))

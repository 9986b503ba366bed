"""``paretoik report``: write one page about a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from paretoik.cli.console import (
    JsonFlag,
    RunFolder,
    RunProblem,
    agreed_problem,
    print_json,
    print_text,
    stdout_for_results,
)


def report(
    run: RunFolder,
    out: Annotated[
        Path | None, typer.Option(help="HTML file to write; report.html in the run's folder.", show_default=False)
    ] = None,
    problem: RunProblem = None,
    overwrite: Annotated[bool, typer.Option(help="Replace a file that is no report.")] = False,
    as_json: JsonFlag = False,
) -> None:
    """Write one HTML page about a run, which needs no network: the front, motions, certificates, choices, settings."""
    with stdout_for_results():
        from paretoik.api.report import report as write_report

        file = write_report(run, out, overwrite=overwrite, problem=agreed_problem(run, problem))
    if as_json:
        print_json({"out": file})
    else:
        print_text(file)

"""``paretoik report``: write one page about a run."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Annotated

import typer

from paretoik.cli.console import JsonFlag, RunFolder, print_json


def report(
    run: RunFolder,
    out: Annotated[
        Path | None, typer.Option(help="HTML file to write; report.html in the run's folder.", show_default=False)
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace a file that is no report.")] = False,
    as_json: JsonFlag = False,
) -> None:
    """Write one HTML page about a run, which needs no network: the front, motions, certificates, choices, settings."""
    with redirect_stdout(sys.stderr):
        from paretoik.api.report import report as write_report

        file = write_report(run, out, overwrite=overwrite)
    if as_json:
        print_json({"out": file})
    else:
        print(file)

"""The options that sub-commands share, each said once."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import typer

from paretoik.cli.console import has_agreed
from paretoik.errors import InvalidInput
from paretoik.run_files import RUN, is_run, problem_words, read_run
from paretoik.shell_command import shell_command

SolverName: TypeAlias = Literal["auto", "interior-point", "sqp"]
Problem = Annotated[str, typer.Argument(help="FILE.py:NAME or package.module:NAME", show_default=False)]
RunProblem = Annotated[
    str | None,
    typer.Option(
        "--problem",
        help="The run's problem, whose file is run (on a terminal: what the run names, if you say yes).",
        metavar="FILE.py:NAME",
        show_default=False,
    ),
]
OutFolder = Annotated[Path, typer.Option(help="Folder to keep the run in.", show_default=False)]
Starts = Annotated[
    int | None,
    typer.Option(help="Starts for every degree of redundancy (up to 48, as many as pay).", show_default=False),
]
Seed = Annotated[int, typer.Option(help="Seed of all chance.")]
SolverOption = Annotated[
    SolverName, typer.Option(help="Interior points (smooth functions), SQP by Clarabel (any), or what suits.")
]
TimeLimit = Annotated[
    float | None, typer.Option(help="Stop after so many seconds of computing and keep the result.", show_default=False)
]
Workers = Annotated[
    int | None, typer.Option(help="Processes on this machine that compute (none: this one).", show_default=False)
]
ClusterAddress = Annotated[
    str | None,
    typer.Option(
        "--cluster", help="Dask scheduler whose workers compute.", metavar="tcp://HOST:PORT", show_default=False
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace a run in the folder, once there is a result.")]


def agreed_problem(run: Path, problem: str | None, *, needed: bool = False) -> str | None:
    """Return ``--problem``, or what a run names if the user agrees on a terminal to run its code, else None.

    Raises InvalidInput, with the command that names it, if the problem is ``needed`` and nobody agreed.
    """
    reference = read_run(run / RUN).get("problem") if problem is None and is_run(run / RUN) else None
    words = problem_words(reference)
    if not words:
        return problem
    place = words[1].rpartition(":")[0]
    code = Path.cwd() / place if place.endswith(".py") else place
    if has_agreed(f"{run} is a run of {words[1]}. Run the code of {code}?"):
        return words[1]
    if needed:
        command = shell_command("paretoik", *sys.argv[1:], *words)
        raise InvalidInput(f"{run}: its problem wanted, whose file is run only if you name it, got none: {command}")
    return None

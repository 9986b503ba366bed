"""The options that sub-commands share, each said once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import typer

SolverName: TypeAlias = Literal["auto", "interior-point", "sqp"]
Problem = Annotated[str, typer.Argument(help="FILE.py:NAME or package.module:NAME", show_default=False)]
RunProblem = Annotated[
    str | None,
    typer.Option(
        "--problem",
        help="The run's problem, FILE.py:NAME, whose file is run (what the run names, if that is this project's).",
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

"""``paretoik list``: the problems that files offer."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Annotated

import typer

from paretoik.cli.console import JsonFlag, print_json, print_message
from paretoik.errors import InvalidInput, ParetoikError
from paretoik.tables import columns


def list_problems(
    files: Annotated[list[str] | None, typer.Argument(help="Problem files; problems/*.py if none.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """List the problems that files offer."""
    from paretoik.loading import problems_in

    places = files or sorted(str(file) for file in Path("problems").glob("[!_]*.py"))
    if not places:
        raise InvalidInput(f"list: wanted a file, got none, and there is no problems/*.py in {Path.cwd()}")
    rows: list[tuple[str, str]] = []
    errors: list[ParetoikError] = []
    for place in places:
        try:
            with redirect_stdout(sys.stderr):
                rows += [(f"{place}:{name}", about) for name, about in problems_in(place).items()]
        except ParetoikError as fault:
            errors.append(fault)
    if as_json:
        print_json([{"problem": name, "about": about} for name, about in rows])
    else:
        print(columns(rows))
    for error in errors:
        print_message("error:", "bold red", str(error))
    if errors:
        raise typer.Exit(errors[0].exit_code)

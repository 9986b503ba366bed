"""``paretoik check-robot``: the faults of a URDF file."""

from __future__ import annotations

from pathlib import Path
from shutil import get_terminal_size
from typing import Annotated

import typer

from paretoik.cli.console import JsonFlag, print_json, print_text
from paretoik.errors import InvalidInput
from paretoik.tables import SCREEN, wrap_text


def check_robot(
    file: Annotated[Path, typer.Argument(help="A URDF file.", show_default=False)],
    base: Annotated[str | None, typer.Option(help="First link of the chain (the root).")] = None,
    tip: Annotated[str | None, typer.Option(help="Last link of the chain (the only leaf).")] = None,
    soft: Annotated[bool, typer.Option("--soft", help="Take the limits of safety controllers.")] = False,
    repair_inertias: Annotated[
        bool,
        typer.Option("--repair-inertias", help="Replace impossible inertias by the nearest that a body has."),
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """List the faults of a URDF file, and the arm that Arm.from_urdf makes of it.

    Warnings that are alike are one, with the first names, and of very many lines the first are printed; --json has
    every fault and every warning.
    """
    from paretoik.robot.urdf import check_robot as check
    from paretoik.robot.urdf import report_text

    report = check(file, base, tip, soft=soft, repair_inertias=repair_inertias)
    if as_json:
        print_json({"summary": report.summary, "warnings": report.warnings, "faults": report.faults})
    else:
        print_text(wrap_text(report_text(report), get_terminal_size((SCREEN.width, SCREEN.lines)).columns))
    if report.faults:
        raise typer.Exit(InvalidInput.exit_code)

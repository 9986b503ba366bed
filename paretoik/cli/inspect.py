"""``paretoik list``: the problems that files offer."""

from __future__ import annotations

from pathlib import Path
from shutil import get_terminal_size
from typing import Annotated

import typer

from paretoik.cli.console import JsonFlag, print_json, print_message, print_text, stdout_for_results
from paretoik.errors import InvalidInput, ParetoikError
from paretoik.tables import SCREEN, columns, wrap_text

# ``paretoik check-robot``: the faults of a URDF file.


def check_robot(
    file: Annotated[Path, typer.Argument(help="A URDF file.", show_default=False)],
    base: Annotated[str | None, typer.Option(help="First link of the chain (the root).")] = None,
    tip: Annotated[str | None, typer.Option(help="Last link of the chain (the only leaf).")] = None,
    soft: Annotated[bool, typer.Option("--soft", help="Take the limits of safety controllers.")] = False,
    repair_inertias: Annotated[
        bool,
        typer.Option("--repair-inertias", help="Replace impossible inertias by the nearest possible ones."),
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """List the faults of a URDF file, and the arm that Arm.from_urdf makes of it.

    Similar warnings are printed as one, with the first names, and of very many lines only the first are printed; --json
    has every fault and every warning.
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


# ``paretoik list``: the problems that files offer.


def list_problems(
    files: Annotated[list[str] | None, typer.Argument(help="Problem files; problems/*.py if none.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """List the problems that files offer."""
    from paretoik.loading import problems_in, unannotated_in

    places = dict.fromkeys(files or sorted(str(file) for file in Path("problems").glob("[!_]*.py")))
    if not places:
        raise InvalidInput(f"files must be at least one, got none, and there is no problems/*.py in {Path.cwd()}")
    rows: list[tuple[str, str]] = []
    errors: list[ParetoikError] = []
    silent: dict[str, list[str]] = {}
    for place in places:
        try:
            with stdout_for_results():
                rows += [(f"{place}:{name}", about) for name, about in problems_in(place).items()]
                silent[place] = unannotated_in(place)
        except ParetoikError as fault:
            errors.append(fault)
    if as_json:
        print_json([{"problem": name, "about": about} for name, about in rows])
    else:
        print_text(columns(rows))
    for place, names in silent.items():
        if not names:
            continue
        text = f"{place} has functions that do not say what they return and may be problems too: {', '.join(names)}"
        print_message("note:", "bold", f"{text}; an annotation, as -> Tracking, lists them")
    for error in errors:
        print_message("error:", "bold red", str(error))
    if errors:
        raise typer.Exit(errors[0].exit_code)

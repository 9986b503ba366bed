"""``paretoik select``: choose one motion of a front by a preference, keep the choice, and undo it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from paretoik.api.progress import open_observer
from paretoik.cli.console import (
    JsonFlag,
    QuietFlag,
    RunFolder,
    RunProblem,
    agreed_problem,
    exit_code,
    print_json,
    print_text,
    stdout_for_results,
)
from paretoik.errors import InvalidInput
from paretoik.runs.files import PICTURE_MARK, RUN, check_target, read_run

NUMBERS = "NAME=NUMBER,NAME=NUMBER"


def select(
    run: RunFolder,
    weights: Annotated[
        str | None, typer.Option(help="Least weighted sum; missing objectives have weight 0.", metavar=NUMBERS)
    ] = None,
    knee: Annotated[
        bool, typer.Option("--knee", help="The point from which any step costs the most relative to its gain.")
    ] = False,
    compromise: Annotated[
        bool,
        typer.Option("--compromise", help="The point whose worst objective gives up the least of its range."),
    ] = False,
    aspiration: Annotated[
        str | None, typer.Option(help="Nearest to values that you wish for, reachable or not.", metavar=NUMBERS)
    ] = None,
    lexicographic: Annotated[
        str | None,
        typer.Option(
            help="The first objective decides, then the second among points within the tolerance of the first, ...; a "
            "tolerance is in the objective's units, with % a share of its range.",
            metavar="NAME[=TOLERANCE],NAME",
        ),
    ] = None,
    bounds: Annotated[
        str | None,
        typer.Option(
            help="Only points within these bounds (in quotes), with or without a preference that then decides.",
            metavar="'NAME<=VALUE,NAME>=VALUE'",
        ),
    ] = None,
    robust: Annotated[
        str | None, typer.Option(help="Least regret if weights are not known exactly.", metavar=NUMBERS)
    ] = None,
    uncertainty: Annotated[
        float | None, typer.Option(help="Share by which the weights of --robust may be wrong (0.2).")
    ] = None,
    classify: Annotated[
        str | None,
        typer.Option(
            help="Class of each objective, from a point: improve, improve:VALUE, keep, relax:VALUE or free (NIMBUS).",
            metavar="NAME=CLASS,NAME=CLASS",
        ),
    ] = None,
    start: Annotated[
        int | None,
        typer.Option("--from", help="Point from which --classify starts (the present choice).", metavar="ID"),
    ] = None,
    point: Annotated[int | None, typer.Option(help="The point with this id.", metavar="ID")] = None,
    history: Annotated[bool, typer.Option("--history", help="Print the tree of choices so far.")] = False,
    undo: Annotated[bool, typer.Option("--undo", help="Go back to the choice before the present one.")] = False,
    picture: Annotated[Path | None, typer.Option(help="Draw the front and the chosen motion into this PNG.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the new run of a closed loop.")] = None,
    overwrite: Annotated[
        bool, typer.Option(help="Replace a run in that folder, or a file that is no picture of ours.")
    ] = False,
    problem: RunProblem = None,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Choose one motion of a front, say why, and keep the choice in the run.

    A closed loop is followed again with other weights at every step.
    """
    options = {
        "weights": weights,
        "knee": knee,
        "compromise": compromise,
        "aspiration": aspiration,
        "lexicographic": lexicographic,
        "robust": robust,
        "classify": classify,
        "point": point,
        "bounds": bounds,
        "uncertainty": uncertainty,
        "from": start,
    }
    wishes = {name: value for name, value in options.items() if value is not None and value is not False}
    if history or undo:
        _show_history(run, wishes, undo=undo, problem=problem, as_json=as_json)
        return
    with stdout_for_results():
        if picture is not None:
            check_target("picture", picture, overwrite=overwrite, mark=PICTURE_MARK)
        from paretoik.api.load import load_front
        from paretoik.api.result_text import choice_entry, choice_text
        from paretoik.api.select import select as select_point
        from paretoik.cli.preference_arguments import read_preference

        preference = read_preference(wishes, run=run)
        front = load_front(run, agreed_problem(run, problem))
        with open_observer(not quiet) as observe:
            selected, choice = select_point(front, preference, out=out, overwrite=overwrite, observe=observe or False)
        if picture is not None:
            from paretoik.review.pictures.fronts import front_picture

            front_picture(selected, picture, choice)
    if as_json:
        print_json(choice_entry(selected, choice))
    else:
        print_text(choice_text(selected, choice))
    if selected is not front:
        raise typer.Exit(exit_code(selected.provenance["status"]))


def _show_history(run: Path, wishes: Mapping[str, object], *, undo: bool, problem: str | None, as_json: bool) -> None:
    """Print the choices of a run, after one step back if ``undo``; raises InvalidInput with a preference."""
    from paretoik.front.choice_tree import read_choices

    if wishes:
        raise InvalidInput(f"--history and --undo must come without a preference, got --{next(iter(wishes))} too")
    read_run(run / RUN)
    if undo:
        with stdout_for_results():
            from paretoik.api.select import undo as go_back

            choices = go_back(run, agreed_problem(run, problem))
    else:
        choices = read_choices(run)
    if as_json:
        print_json(asdict(choices))
    else:
        print_text(choices.text)

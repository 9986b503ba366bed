"""``paretoik navigate``: move along the front of a run to a new certified point."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from paretoik.api.result_text import choice_text, entries
from paretoik.cli.console import (
    JsonFlag,
    RunFolder,
    RunProblem,
    agreed_problem,
    print_json,
    print_text,
    stdout_for_results,
)
from paretoik.front.front import Front
from paretoik.front.points import NAVIGATIONS
from paretoik.paths import shell_command
from paretoik.runs.files import problem_words


def navigate(
    run: RunFolder,
    improve: Annotated[str, typer.Option(help="The objective that gets better.", show_default=False)],
    point: Annotated[
        int | None, typer.Option(help="Id of the point to move from (the present choice).", show_default=False)
    ] = None,
    allow: Annotated[
        list[str] | None,
        typer.Option(help="An objective that may get worse; repeatable (all not held).", show_default=False),
    ] = None,
    hold: Annotated[
        list[str] | None, typer.Option(help="An objective that gets no worse; may be repeated.", show_default=False)
    ] = None,
    by: Annotated[float | None, typer.Option(help="Improvement, in its unit (5 % of its range).")] = None,
    to: Annotated[float | None, typer.Option(help="Value to reach, in its unit, in place of --by.")] = None,
    out: Annotated[Path | None, typer.Option(help="Keep the new front in this folder, not in the run.")] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace a run that is in that folder.")] = False,
    problem: RunProblem = None,
    as_json: JsonFlag = False,
) -> None:
    """Move from one point of a front to a new certified one that is better in an objective; the run gains it.

    Nothing is lost: if the new point dominates points of the run, the new front is kept in a folder next to it.
    The recording opens on the new point, next to the present choice of the run if there is one.
    """
    with stdout_for_results():
        from paretoik.api.navigate import navigate as move

        front, choice, place = move(
            run,
            point,
            improve=improve,
            allow=allow,
            hold=hold or (),
            by=by,
            to=to,
            out=out,
            overwrite=overwrite,
            problem=agreed_problem(run, problem, needed=True),
        )
    start = front.provenance[NAVIGATIONS][-1]["from"]
    if as_json:
        print_json({**entries(front)[choice.index], **front.provenance[NAVIGATIONS][-1], "out": place})
    else:
        if point is None:
            print_text(f"from the present choice, point {start}:")
        print_text(choice_text(front, choice))
        print_text(f"kept in {place}{_why_beside(front, run) if out is None and place != run else ''}")
        named = problem_words(front.provenance.get("problem"))
        print_text(f"export:  {shell_command('paretoik', 'export', place, '--point', str(choice.id), *named)}")


def _why_beside(front: Front, run: Path) -> str:
    """Return why a new front is not kept in the run itself."""
    if front.provenance[NAVIGATIONS][-1]["dominated"]:
        return f", because the new point dominates points of {run}, which keeps them"
    return f", because {run} was stopped, and resuming it would drop the new point"

"""The command line: list, solve, select, show, check-robot. Results go to stdout, progress and errors to stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from paretoik.errors import InvalidInput, ParetoikError

if TYPE_CHECKING:
    from paretoik.front.front import Choice, Front
    from paretoik.solving import Observer

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="The whole Pareto front of joint motions for a redundant arm.",
)

JsonFlag = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
RunFolder = Annotated[Path, typer.Argument(help="Folder of a finished run.", show_default=False)]
STOPPED_BY_LIMIT = 5
EXIT_CODES = {
    "time limit": STOPPED_BY_LIMIT,
    "evaluations": STOPPED_BY_LIMIT,
    "SIGINT": 130,
    "interrupted": 130,
    "SIGTERM": 143,
}


def main() -> None:
    """Run the command line; every error that a user can cause is one line and an exit code."""
    try:
        app()
    except ParetoikError as error:
        Console(stderr=True).print(f"[bold red]error:[/] {_escaped(str(error))}", soft_wrap=True, highlight=False)
        sys.exit(error.exit_code)


@app.command("list")
def list_problems(
    files: Annotated[list[str] | None, typer.Argument(help="Problem files; problems/*.py if none.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """List the problems that files offer."""
    from paretoik.loading import problems_in

    places = files or sorted(str(file) for file in Path("problems").glob("[!_]*.py"))
    if not places:
        raise InvalidInput(f"list: no problems/*.py in {Path.cwd()}; name a file")
    found = [(f"{place}:{name}", said) for place in places for name, said in problems_in(place).items()]
    if as_json:
        print(json.dumps([{"problem": name, "about": said} for name, said in found], indent=2))
        return
    table = Table("problem", "about", box=None)
    for name, said in found:
        table.add_row(name, said)
    Console().print(table)


@app.command()
def solve(
    problem: Annotated[str, typer.Argument(help="FILE.py:NAME or package.module:NAME", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder to keep the run in.", show_default=False)],
    population: Annotated[int, typer.Option(help="Size of the population.")] = 100,
    generations: Annotated[int, typer.Option(help="Most generations.")] = 300,
    seed: Annotated[int, typer.Option(help="Seed of all chance.")] = 0,
    time_limit: Annotated[float | None, typer.Option(help="Stop after so many seconds and keep the result.")] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace a run that is in the folder.")] = False,
    quiet: Annotated[bool, typer.Option(help="No progress.")] = False,
    as_json: JsonFlag = False,
) -> None:
    """Search for the front of a problem and keep the run."""
    with _status("loading the problem", quiet):
        from paretoik import solving
        from paretoik.loading import load_problem

        opened = load_problem(problem)
    with _progress(generations, quiet) as observe:
        front = solving.solve(
            opened,
            population=population,
            generations=generations,
            seed=seed,
            out=out,
            time_limit=time_limit,
            overwrite=overwrite,
            reference=problem,
            observe=observe,
        )
    status = str(front.provenance["status"])
    if as_json:
        print(json.dumps({"front": _front_entries(front), "out": str(out), **front.provenance}, indent=2))
    else:
        _print_front(front, out)
    raise typer.Exit(EXIT_CODES.get(status, 0))


@app.command()
def select(
    run: RunFolder,
    weights: Annotated[str, typer.Option(help="NAME=NUMBER,NAME=NUMBER; what is missing is 0.", show_default=False)],
    picture: Annotated[Path | None, typer.Option(help="Draw the front and the chosen motion into this PNG.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Choose one motion of a front by weights (Marcos et al. 2012, Eqs. 19 and 20)."""
    from paretoik.front.preferences import Weights
    from paretoik.solving import load_front

    preference = Weights(_weights(weights))
    front = load_front(run)
    choice = front.select(preference)
    if picture is not None:
        from paretoik.review.plots import front_picture

        front_picture(front, picture, choice)
    if as_json:
        print(json.dumps(_choice_entries(front, choice), indent=2))
        return
    console = Console()
    console.print(f"[bold]point {choice.id}[/]", highlight=False)
    for name, unit, value in zip(front.names, front.units, choice.objectives, strict=True):
        console.print(f"  {_escaped(name)} = {value:.6g} {_escaped(unit)}", highlight=False)
    console.print(_escaped(choice.reason), soft_wrap=True, highlight=False)


@app.command()
def show(run: RunFolder) -> None:
    """Open the recording of a run in the Rerun viewer."""
    from paretoik.review.viewer import show as open_viewer

    open_viewer(run)


@app.command("check-robot")
def check_robot(
    file: Annotated[Path, typer.Argument(help="A URDF file.", show_default=False)],
    base: Annotated[str | None, typer.Option(help="First link of the chain (the root).")] = None,
    tip: Annotated[str | None, typer.Option(help="Last link of the chain (the only leaf).")] = None,
) -> None:
    """List every fault of a URDF file, and what paretoik would make of it."""
    from paretoik.robot.urdf import check_robot as check

    report = check(file, base, tip)
    console = Console()
    for line in report.summary:
        console.print(_escaped(line), soft_wrap=True, highlight=False)
    for line in report.warnings:
        console.print(f"[yellow]warning:[/] {_escaped(line)}", soft_wrap=True, highlight=False)
    for line in report.faults:
        console.print(f"[red]fault:[/] {_escaped(line)}", soft_wrap=True, highlight=False)
    if report.faults:
        raise typer.Exit(InvalidInput.exit_code)
    console.print("no faults", highlight=False)


def _weights(text: str) -> dict[str, float]:
    found: dict[str, float] = {}
    for part in text.split(","):
        name, separator, value = part.partition("=")
        name = name.strip()
        if not separator or not name:
            raise InvalidInput(f"weights: wants NAME=NUMBER,NAME=NUMBER, got {part!r}")
        if name in found:
            raise InvalidInput(f"weights: wants each objective once, got {name} twice")
        try:
            found[name] = float(value)
        except ValueError:
            raise InvalidInput(f"weights: wants a number for {name}, got {value!r}") from None
    return found


@contextmanager
def _status(text: str, quiet: bool) -> Iterator[None]:
    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield
        return
    with console.status(text):
        yield


@contextmanager
def _progress(generations: int, quiet: bool) -> Iterator[Observer | None]:
    """Yield an observer that draws a bar on stderr, or, where that is no terminal, prints a line now and then."""
    if quiet:
        yield None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if not console.is_terminal:

        def tell(generation: Any, progress: Any) -> None:
            if generation.number == 1 or generation.number % 25 == 0:
                console.print(f"generation {generation.number}/{generations}, {_state(generation)}", soft_wrap=True)

        yield tell
        return
    columns = (
        TextColumn("generation {task.completed}/{task.total}"),
        BarColumn(),
        TextColumn("{task.description}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        job = bar.add_task("", total=generations)
        yield lambda generation, progress: bar.update(job, completed=generation.number, description=_state(generation))


def _state(generation: Any) -> str:
    failed = f", {generation.failed} failed" if generation.failed else ""
    return f"front {len(generation.front)}, hypervolume {generation.hypervolume:.4g}{failed}"


def _print_front(front: Front, out: Path) -> None:
    counts = front.provenance["counts"]
    table = Table("objective", "unit", "best", "worst on the front", box=None)
    for name, unit, maximised, column in zip(
        front.names, front.units, front.maximised, front.objectives.T, strict=True
    ):
        best, worst = (column.max(), column.min()) if maximised else (column.min(), column.max())
        table.add_row(_escaped(name), _escaped(unit), f"{best:.6g}", f"{worst:.6g}")
    console = Console()
    console.print(
        f"{len(front)} points after {counts['generations']} generations, {counts['evaluations']} evaluations and "
        f"{counts['seconds']:.1f} s (ended by {front.provenance['status']})",
        highlight=False,
    )
    console.print(table)
    if counts["failed"]:
        console.print(f"{counts['failed']} evaluations failed, the first with: {_escaped(counts['first_cause'])}")
    weights = ",".join(f"{name}={1 / len(front.names):.2g}" for name in front.names)
    console.print(f"choose:  paretoik select {out} --weights {weights}", soft_wrap=True, highlight=False)
    console.print(f"replay:  paretoik show {out}", soft_wrap=True, highlight=False)


def _front_entries(front: Front) -> list[dict[str, float | int]]:
    return [
        {"id": int(number), **{name: float(value) for name, value in zip(front.names, row, strict=True)}}
        for number, row in zip(front.ids, front.objectives, strict=True)
    ]


def _choice_entries(front: Front, choice: Choice) -> dict[str, Any]:
    values = {name: float(value) for name, value in zip(front.names, choice.objectives, strict=True)}
    return {"id": choice.id, "objectives": values, "reason": choice.reason}


def _escaped(text: str) -> str:
    from rich.markup import escape

    return escape(text)

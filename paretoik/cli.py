"""The command line: list, solve, select, show, check-robot. Results go to stdout, progress and errors to stderr."""

from __future__ import annotations

import json
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.text import Text

from paretoik.api.summary import choice_text, columns, entries, result_text
from paretoik.errors import InvalidInput, ParetoikError

if TYPE_CHECKING:
    from paretoik.api.solve import Observer
    from paretoik.review.generation import Generation
    from paretoik.search.progress import Progress

STOPPED_BY_LIMIT = 5
EXIT_CODES = {"time limit": STOPPED_BY_LIMIT, "SIGINT": 130, "interrupted": 130, "SIGTERM": 143}
SECONDS_BETWEEN_LINES = 5.0  # of progress, where stderr is no terminal

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="The whole Pareto front of joint motions for a redundant arm.",
    epilog="Exit codes: 0 done, 2 bad input, 3 infeasible, 4 all evaluations failed, 5 stopped by a limit and "
    "130 or 143 interrupted, with the result kept.",
)
JsonFlag = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
RunFolder = Annotated[Path, typer.Argument(help="Folder of a finished run.", show_default=False)]


def main() -> None:
    """Run the command line; every error that a user can cause is one line on stderr and an exit code."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_, **__: _tell("warning:", "yellow", str(message))
        try:
            app()
        except ParetoikError as error:
            _tell("error:", "bold red", str(error))
            sys.exit(error.exit_code)


def _version(wanted: bool) -> bool:
    if wanted:
        from paretoik import __version__

        print(f"paretoik {__version__}")
        raise typer.Exit
    return wanted


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


@app.command("list")
def list_problems(
    files: Annotated[list[str] | None, typer.Argument(help="Problem files; problems/*.py if none.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """List the problems that files offer; a file that cannot be loaded does not hide the others."""
    from paretoik.loading import problems_in

    places = files or sorted(str(file) for file in Path("problems").glob("[!_]*.py"))
    if not places:
        raise InvalidInput(f"list: wanted a file, got none, and there is no problems/*.py in {Path.cwd()}")
    found: list[tuple[str, str]] = []
    faults: list[ParetoikError] = []
    for place in places:
        try:
            with redirect_stdout(sys.stderr):
                found += [(f"{place}:{name}", about) for name, about in problems_in(place).items()]
        except ParetoikError as error:
            faults.append(error)
    if as_json:
        _print_json([{"problem": name, "about": about} for name, about in found])
    else:
        print(columns(found))
    for fault in faults:
        _tell("error:", "bold red", str(fault))
    if faults:
        raise typer.Exit(faults[0].exit_code)


@app.command()
def solve(
    problem: Annotated[str, typer.Argument(help="FILE.py:NAME or package.module:NAME", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder to keep the run in.", show_default=False)],
    population: Annotated[
        int | None, typer.Option(help="Size of the population (200; of a closed loop its own).", show_default=False)
    ] = None,
    generations: Annotated[
        int | None, typer.Option(help="Most generations (500; of a closed loop its own).", show_default=False)
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of all chance (0).", show_default=False)] = None,
    time_limit: Annotated[float | None, typer.Option(help="Stop after so many seconds and keep the result.")] = None,
    refine: Annotated[bool, typer.Option("--refine", help="Let gradients help, and certify every point.")] = False,
    overwrite: Annotated[bool, typer.Option(help="Replace a run that is in the folder.")] = False,
    quiet: Annotated[bool, typer.Option(help="No progress.")] = False,
    as_json: JsonFlag = False,
) -> None:
    """Search for the front of a problem, or follow a closed loop, and keep the run.

    Ctrl-C ends it early with what was found.
    """
    with redirect_stdout(sys.stderr):  # a user's functions may print, and stdout is for the result
        with _status("loading the problem", quiet):
            from paretoik.api import solve as solving
            from paretoik.loading import load_problem

            opened = load_problem(problem)
        with _progress(_course(opened, generations), time_limit, quiet) as (observe, polished):
            front = solving.solve(
                opened,
                population=population,
                generations=generations,
                seed=seed,
                out=out,
                time_limit=time_limit,
                refine=refine,
                overwrite=overwrite,
                reference=problem,
                observe=observe,
                observe_refining=polished,
            )
    if as_json:
        _print_json({**front.provenance, "out": out, "front": entries(front)})
    else:
        print(result_text(front, out))
    raise typer.Exit(EXIT_CODES.get(str(front.provenance["status"]), 0))


@app.command()
def select(
    run: RunFolder,
    weights: Annotated[str, typer.Option(help="NAME=NUMBER,NAME=NUMBER; what is missing is 0.", show_default=False)],
    picture: Annotated[Path | None, typer.Option(help="Draw the front and the chosen motion into this PNG.")] = None,
    out: Annotated[Path | None, typer.Option(help="Of a closed loop: keep the new run in this folder.")] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace a run that is in that folder.")] = False,
    quiet: Annotated[bool, typer.Option(help="No progress.")] = False,
    as_json: JsonFlag = False,
) -> None:
    """Choose one motion of a front by weights (Marcos et al. 2012, Eqs. 19 and 20).

    A closed loop is followed anew with these weights at every step.
    """
    with redirect_stdout(sys.stderr):
        from paretoik.api import solve as solving
        from paretoik.front.preferences import Weights

        preference = Weights(_weights(weights))
        front = solving.load_front(run)
        loop = solving.reweighed(front, preference)
        if loop is not None:
            with _progress(_course(loop, None), None, quiet) as (observe, _):
                front = solving.solve(
                    loop,
                    out=out,
                    overwrite=overwrite,
                    reference=front.provenance.get("problem"),
                    observe=observe,
                )
        elif out is not None:
            raise InvalidInput("out: wants a closed loop and other weights than its own, to keep a new run in")
        choice = front.select(preference)
        if picture is not None:
            from paretoik.review.plots import front_picture

            front_picture(front, picture, choice)
    if as_json:
        _print_json({**entries(front)[choice.index], "reason": choice.reason})
    else:
        print(choice_text(front, choice))
    if loop is not None:
        raise typer.Exit(EXIT_CODES.get(str(front.provenance["status"]), 0))


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
    as_json: JsonFlag = False,
) -> None:
    """List every fault of a URDF file, and what paretoik would make of it."""
    from paretoik.robot.urdf import check_robot as check

    report = check(file, base, tip)
    if as_json:
        _print_json({"summary": report.summary, "warnings": report.warnings, "faults": report.faults})
    else:
        lines = [*report.summary, *(f"warning: {line}" for line in report.warnings)]
        lines += [f"fault: {line}" for line in report.faults] or ["no faults"]
        print("\n".join(lines))
    if report.faults:
        raise typer.Exit(InvalidInput.exit_code)


def _weights(text: str) -> dict[str, float]:
    found: dict[str, float] = {}
    for part in text.split(","):
        name, separator, value = part.partition("=")
        name = name.strip()
        if not separator or not name:
            raise InvalidInput(f"weights: wanted NAME=NUMBER,NAME=NUMBER, got {part!r}")
        if name in found:
            raise InvalidInput(f"weights: wanted each objective once, got {name} twice")
        try:
            found[name] = float(value)
        except ValueError:
            raise InvalidInput(f"weights: wanted a number for {name}, got {value!r}") from None
    return found


@contextmanager
def _status(text: str, quiet: bool) -> Iterator[None]:
    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield
        return
    with console.status(text):
        yield


def _course(problem: Any, generations: int | None) -> tuple[str, int]:
    """Return what is counted on the way, and how many there are at most."""
    if hasattr(problem, "reweighed"):
        return "step", len(problem.task.times) - 1
    from paretoik.api.solve import GENERATIONS

    return "generation", GENERATIONS if generations is None else generations


@contextmanager
def _progress(
    course: tuple[str, int], time_limit: float | None, quiet: bool
) -> Iterator[tuple[Observer | None, Callable[[int, int], None] | None]]:
    """Yield observers of generations and of points polished.

    They draw a bar on stderr, or, where that is no terminal, print a line now and then.
    """
    console = Console(stderr=True)
    if quiet:
        yield None, None
    elif console.is_terminal:
        from rich import progress as rich

        bar = rich.Progress(rich.BarColumn(), rich.TextColumn("{task.description}"), console=console, transient=True)
        with bar:
            job = bar.add_task(
                "{} 0/{}: preparing, the first time for a minute or two".format(*course), total=course[1]
            )
            yield (
                lambda generation, progress: bar.update(
                    job, completed=generation.number, description=_state(generation, progress, course, time_limit)
                ),
                lambda done, wanted: bar.update(job, completed=done, total=wanted, description=_polished(done, wanted)),
            )
    else:
        say = _Printer()
        yield (
            lambda generation, progress: say(lambda: _state(generation, progress, course, time_limit)),
            lambda done, wanted: say(lambda: _polished(done, wanted)),
        )


class _Printer:
    """Prints a line on stderr, but not more often than every few seconds."""

    def __init__(self) -> None:
        self.due = 0.0

    def __call__(self, text: Callable[[], str]) -> None:
        now = time.monotonic()
        if now >= self.due:
            self.due = now + SECONDS_BETWEEN_LINES
            print(text(), file=sys.stderr, flush=True)


def _polished(done: int, wanted: int) -> str:
    return f"polishing, point {done}/{wanted}"


def _state(generation: Generation, progress: Progress, course: tuple[str, int], time_limit: float | None) -> str:
    what, most = course
    left = progress.seconds / generation.number * (most - generation.number)
    if time_limit is not None:
        left = min(left, max(time_limit - progress.seconds, 0.0))
    minutes, seconds = divmod(round(left), 60)
    failed = f", {generation.failed} failed" if generation.failed else ""
    volume = "" if generation.hypervolume is None else f", hypervolume {generation.hypervolume:.4g}"
    return (
        f"{what} {generation.number}/{most}, front {len(generation.front)}{volume}{failed}, "
        f"at most {minutes}:{seconds:02} left"
    )


def _print_json(value: object) -> None:
    from paretoik.run_files import to_json

    print(json.dumps(to_json(value), indent=2, allow_nan=False))


def _tell(what: str, style: str, text: str) -> None:
    Console(stderr=True).print(Text.assemble((what, style), " ", " ".join(text.split())), soft_wrap=True)

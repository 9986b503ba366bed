"""The command ``paretoik``; a user's error is one line and a code."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from signal import SIGTERM
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from paretoik.cli.choices import navigate, select
from paretoik.cli.console import NO_RESULT, print_error, print_message, process_output
from paretoik.cli.inspect import check_robot, list_problems, warmup
from paretoik.cli.results import compare, export, report, show, verify
from paretoik.cli.runs import front, plan, refine, resume, solve
from paretoik.errors import InvalidInput, ParetoikError

USAGE_ERRORS: Any = typer.BadParameter.__base__  # base of all errors of the parser; it has no public name


class Commands(TyperGroup):
    """The sub-commands. Wrong arguments are reported in one line, and a signal before there is a result too."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Return the context of a command line. Raises InvalidInput for wrong arguments."""
        with _one_line():
            return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: Any) -> object:
        """Run a sub-command."""
        try:
            with _one_line():
                return super().invoke(ctx)
        except (KeyboardInterrupt, SystemExit) as end:
            if isinstance(end, SystemExit) and end.code != 128 + SIGTERM:
                raise
            print_error("interrupted before there was a whole result", end)
            sys.exit(NO_RESULT)


@contextmanager
def _one_line() -> Iterator[None]:
    """Turn the parser's errors into InvalidInput."""
    try:
        yield
    except USAGE_ERRORS as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            raise
        about = "paretoik" if error.ctx is None else error.ctx.command_path
        text = error.format_message().rstrip(".")
        raise InvalidInput(f"{text}; see '{about} --help'") from None


app = typer.Typer(
    cls=Commands,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="The whole Pareto front of joint motions for a redundant arm.",
    epilog="Exit codes: 0 done, 2 bad input, 3 infeasible, 4 all evaluations failed or no solver had a solution, "
    "5 stopped by a limit and 130 or 143 interrupted, with the result kept, 6 interrupted before there was one, "
    "7 a verification that fails.",
)
COMMANDS = (
    *(list_problems, solve, plan, front, refine, resume, select, navigate, show, export, report, compare, verify),
    *(warmup, check_robot),
)  # in the order of the help
for command in COMMANDS:
    app.command({list_problems: "list", check_robot: "check-robot"}.get(command))(command)


def main() -> None:
    """Run the command line."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_, **__: print_message("warning:", "yellow", str(message))
        try:
            with process_output():
                app(prog_name="paretoik")
        except ParetoikError as error:
            print_error(str(error), error)
            sys.exit(error.exit_code)


def _print_version(requested: bool) -> bool:
    if requested:
        from paretoik import __version__

        print(f"paretoik {__version__}")
        raise typer.Exit
    return requested


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass

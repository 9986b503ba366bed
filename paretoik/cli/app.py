"""The command ``paretoik`` with its sub-commands; every error that a user can cause is a line and an exit code."""

from __future__ import annotations

import sys
import warnings
from signal import SIGTERM
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from paretoik.cli.check_robot import check_robot
from paretoik.cli.compare import compare
from paretoik.cli.console import NO_RESULT, print_message
from paretoik.cli.export import export
from paretoik.cli.front import front
from paretoik.cli.list_problems import list_problems
from paretoik.cli.navigate import navigate
from paretoik.cli.output import process_output
from paretoik.cli.plan import plan
from paretoik.cli.refine import refine
from paretoik.cli.report import report
from paretoik.cli.resume import resume
from paretoik.cli.select import select
from paretoik.cli.show import show
from paretoik.cli.solve import solve
from paretoik.cli.verify import verify
from paretoik.errors import ParetoikError


class Commands(TyperGroup):
    """The sub-commands; a signal that comes before there is anything to keep is a line and an exit code."""

    def invoke(self, ctx: Any) -> object:
        """Run a sub-command."""
        try:
            return super().invoke(ctx)
        except (KeyboardInterrupt, SystemExit) as end:
            if isinstance(end, SystemExit) and end.code != 128 + SIGTERM:
                raise
            print_message("error:", "bold red", "interrupted before there was a whole result")
            sys.exit(NO_RESULT)


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
app.command("list")(list_problems)
app.command()(solve)
app.command()(plan)
app.command()(front)
app.command()(refine)
app.command()(resume)
app.command()(select)
app.command()(navigate)
app.command()(show)
app.command()(export)
app.command()(report)
app.command()(compare)
app.command()(verify)
app.command("check-robot")(check_robot)


def main() -> None:
    """Run the command line."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_, **__: print_message("warning:", "yellow", str(message))
        try:
            with process_output():
                app()
        except ParetoikError as error:
            print_message("error:", "bold red", str(error))
            for note in getattr(error, "__notes__", ()):
                print_message("note:", "yellow", note)
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

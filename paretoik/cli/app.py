"""The command ``paretoik`` with its sub-commands; an error of a user is one line and an exit code."""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from signal import SIGTERM
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from paretoik.cli.compare import compare
from paretoik.cli.console import NO_RESULT, print_error, print_message, process_output
from paretoik.cli.export import export
from paretoik.cli.front import front
from paretoik.cli.inspect import check_robot, list_problems
from paretoik.cli.navigate import navigate
from paretoik.cli.plan import plan
from paretoik.cli.refine import refine
from paretoik.cli.report import report
from paretoik.cli.resume import resume
from paretoik.cli.select import select
from paretoik.cli.show import show
from paretoik.cli.solve import solve
from paretoik.cli.verify import verify
from paretoik.cli.warmup import warmup
from paretoik.errors import InvalidInput, ParetoikError
from paretoik.inputs import likely_spelling, shown

# Errors in the words of a command line, in one line: the name, what it must be, and what it is.


USAGE_ERRORS: Any = typer.BadParameter.__base__  # base of all errors of the parser, by no public name
WISHES = {"integer": "an integer", "number": "a number", "float": "a number"}  # by the words of the parser


def refusal_of(error: Any, words: Sequence[str], commands: Sequence[str]) -> InvalidInput:
    """Return a fault that the parser found in the ``words`` of a command line as our own error."""
    command = next((word for word in words if word in commands), "")
    kind, option = type(error).__name__, getattr(error, "option_name", "")
    if kind == "NoSuchOption":
        options = [name for each in error.ctx.command.params for name in each.opts if name.startswith("-")]
        text = f"option must be an option of {command or 'paretoik'}, got {shown(option)}"
        return _refusal(command, text + likely_spelling(option, options))
    if kind == "BadOptionUsage":
        has_value = "requires" not in str(error)
        text = f"{option} must have no value, got one" if has_value else f"{option} must have a value, got none"
        return _refusal(command, text)
    if kind == "MissingParameter":
        return _refusal(command, f"{_name(error.param)} must have a value, got none")
    if getattr(error, "param", None) is not None:
        return _refusal(command, f"{_name(error.param)} must be {_wish(str(error))}, got {_fact(error, words)}")
    name = re.fullmatch(r"No such command '(.*?)'\..*", str(error), re.DOTALL)
    if name is not None:
        text = f"command must be one of {', '.join(commands)}, got {shown(name[1])}"
        return _refusal("", text + likely_spelling(name[1], commands))
    extra = re.fullmatch(r".*unexpected extra argument(?:s|\(s\))? \((.*)\)", str(error), re.DOTALL)
    text = "arguments must be fewer" if extra is not None else "command line must have other words"
    return _refusal(command, f"{text}, got {shown(extra[1] if extra is not None else str(error))}")


def _refusal(command: str, text: str) -> InvalidInput:
    about = f"paretoik {command}".strip()
    return InvalidInput(f"{text}; '{about} --help' says what there is")


def _name(param: Any) -> str:
    return str(max(param.opts, key=len))


def _wish(message: str) -> str:
    """Return what a value must be, from the parser's message, or this message itself if it says something else."""
    if choices := _choices(message):
        return f"one of {', '.join(choices)}"
    return next((wish for word, wish in WISHES.items() if word in message), f"another value ({message})")


def _choices(message: str) -> list[str]:
    """Return the choices in a message of the parser."""
    listed = re.search(r"is not one of (.*?)\.?$", message, re.DOTALL)
    return [] if listed is None else listed[1].replace("'", "").split(", ")


def _fact(error: Any, words: Sequence[str]) -> str:
    """Return the value of an option, after its name or its equals sign, and what it may mean."""
    values = [
        word.partition("=")[2] if "=" in word else after
        for word, after in zip(words, [*words[1:], ""], strict=True)
        if word.partition("=")[0] in error.param.opts
    ]
    return f"{shown(values[-1])}{likely_spelling(values[-1], _choices(str(error)))}" if values else "another"


# The command and its sub-commands.


class Commands(TyperGroup):
    """The sub-commands; wrong words, and a signal before there is a result, are one line each."""

    words: tuple[str, ...] = ()

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Read the words of a command line."""
        self.words = tuple(args)
        with self._one_line():
            return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: Any) -> object:
        """Run a sub-command."""
        try:
            with self._one_line():
                return super().invoke(ctx)
        except (KeyboardInterrupt, SystemExit) as end:
            if isinstance(end, SystemExit) and end.code != 128 + SIGTERM:
                raise
            print_error("interrupted before there was a whole result", end)
            sys.exit(NO_RESULT)

    @contextmanager
    def _one_line(self) -> Iterator[None]:
        try:
            yield
        except USAGE_ERRORS as error:
            if type(error).__name__ == "NoArgsIsHelpError":
                raise
            raise refusal_of(error, self.words, list(self.commands)) from None


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
app.command()(warmup)
app.command("check-robot")(check_robot)


def main() -> None:
    """Run the command line."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_, **__: print_message("warning:", "yellow", str(message))
        try:
            with process_output():
                app()
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

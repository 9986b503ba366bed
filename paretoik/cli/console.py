"""What sub-commands share: arguments, results on stdout, messages on stderr, and exit codes."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer
from rich.console import Console
from rich.text import Text

from paretoik.cli.output import STDERR, STDOUT
from paretoik.errors import SolverFailed

if TYPE_CHECKING:
    from paretoik.front.front import Front

JsonFlag = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
QuietFlag = Annotated[bool, typer.Option("--quiet", help="No progress.")]
RunFolder = Annotated[Path, typer.Argument(help="Folder of a finished run.", show_default=False)]
NO_RESULT = 6  # the exit code of what was interrupted before there was a result
NOT_VERIFIED = 7  # the exit code of a verification that fails
EXIT_CODES = {"time limit": 5, "SIGINT": 130, "interrupted": 130, "SIGTERM": 143}  # of what stopped a run


def exit_code(status: object) -> int:
    """Return the exit code of a run that kept its result, by what ended it."""
    return EXIT_CODES.get(str(status), 0)


@contextmanager
def stdout_for_results() -> Iterator[None]:
    """Lead what the body prints on stdout to stderr: a user's functions may print, and so may what they start.

    Programs and libraries write where the process's own stdout leads, past Python's.
    """
    print(end="", flush=True)
    stdout = os.dup(STDOUT)
    os.dup2(STDERR, STDOUT)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        os.dup2(stdout, STDOUT)
        os.close(stdout)


@contextmanager
def says_how_to_go_on(out: Path | None, time_limit: float | None = None) -> Iterator[None]:
    """Let what ends the body before there is a result say, in a note, which command goes on from there.

    That is a signal, or a time limit in which nothing was found.
    """
    try:
        yield
    except (KeyboardInterrupt, SystemExit, SolverFailed) as end:
        from paretoik.api.run_text import resume_command

        limited = not isinstance(end, SolverFailed) or time_limit is not None
        command = resume_command(out) if out is not None and limited else None
        if command is not None:
            end.add_note(f"{command} goes on with it")
        raise


def print_json(value: object) -> None:
    """Print a result as strict JSON."""
    from paretoik.run_files import to_json

    print(json.dumps(to_json(value), indent=2, allow_nan=False))


def finish_front(front: Front, out: Path, *, as_json: bool) -> NoReturn:
    """Print the front of a run that ended, as text or JSON, and exit with the code of what ended it."""
    from paretoik.api.result_text import entries, result_text
    from paretoik.api.run_text import resume_command

    if as_json:
        gaps = {"jumps": front.jumps, "missing_hypervolume": front.missing_hypervolume}
        resume = resume_command(out, front.provenance["status"])
        print_json({**front.provenance, **gaps, "out": out, "resume": resume, "front": entries(front)})
    else:
        print_text(result_text(front, out))
    raise typer.Exit(exit_code(front.provenance["status"]))


def print_text(text: object) -> None:
    """Print a result on stdout, in whose lines nothing steers a terminal: names may come from a file."""
    print("\n".join(map(_plain, str(text).split("\n"))))


def print_message(kind: str, style: str, text: str) -> None:
    """Print a message on stderr, as one line that starts with its kind."""
    Console(stderr=True).print(Text.assemble((kind, style), " ", _one_line(text)), soft_wrap=True)


def print_error(text: str, error: BaseException) -> None:
    """Print what an error is on stderr, and its notes, a line each."""
    print_message("error:", "bold red", text)
    for note in getattr(error, "__notes__", ()):
        print_message("note:", "yellow", note)


def has_agreed(question: str) -> bool:
    """Ask on the terminal and return whether the answer is yes; without a terminal it is no."""
    if not all(getattr(stream, "isatty", bool)() for stream in (sys.stdin, sys.stderr)):
        return False
    print(f"{_one_line(question)} [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in ("y", "yes")


def _one_line(text: str) -> str:
    """Return text as a line in which nothing steers a terminal."""
    return _plain(" ".join(filter(None, map(str.strip, text.splitlines()))))


def _plain(line: str) -> str:
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in line)

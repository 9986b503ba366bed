"""Shared parts of sub-commands: arguments, results, messages and exit codes."""

from __future__ import annotations

import codecs
import errno
import json
import os
import select
import sys
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from io import BufferedWriter, FileIO, TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn, TypeAlias

import typer
from rich.console import Console
from rich.text import Text

from paretoik.errors import InvalidInput, SolverFailed
from paretoik.file_paths import shell_command
from paretoik.progress import Observer, open_observer
from paretoik.runs.files import RUN, is_run, problem_words, read_run, to_json

if TYPE_CHECKING:
    from paretoik.front.front import Front
    from paretoik.trajectory.plan import Plan

# Stdout and stderr of the process: a failed write does not end a command; letters that they cannot show are replaced.


PLAIN = str.maketrans(  # letters that Unicode does not decompose
    dict(zip("−–×·", "--x*", strict=True))
    | {"ε": "eps", "χ": "chi", "π": "pi", "∂": "d", "≤": "<=", "≥": ">=", "°": " deg", "“": '"', "”": '"'}
)
STDIN, STDOUT, STDERR = 0, 1, 2  # descriptors of the process


@contextmanager
def process_output() -> Iterator[None]:
    """Replace stdout and stderr by streams that never raise.

    They may be full, closed, missing or limited to ASCII. Raises InvalidInput if the body ends without error or exits,
    but the output was not written completely. Does not raise if the reader left early or stdout is closed.
    """
    for descriptor in (STDIN, STDOUT, STDERR):  # if a descriptor were closed, the next opened file would get its number
        try:
            os.fstat(descriptor)
        except OSError:  # opening uses the lowest free descriptor
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    codecs.register_error("paretoik.plain", _plain_letters)
    sys.stderr = _lenient(sys.stderr, sys.__stderr__, STDERR)
    sys.stdout = _lenient(sys.stdout, sys.__stdout__, STDOUT)
    try:
        yield
    except SystemExit:
        _check_written(sys.stdout)
        raise
    _check_written(sys.stdout)


class _LenientFile(FileIO):
    """A descriptor that remembers errors instead of raising them."""

    fault: OSError | None = None  # the first one

    def write(self, content: Any) -> int:
        """Write to the descriptor; if that fails, drop the content and keep the first error in ``fault``."""
        try:
            while (written := super().write(content)) is None:  # another process made the descriptor non-blocking
                select.select([], [self], [])
        except OSError as fault:
            self.fault = self.fault or fault
            return len(content)
        return written


def _lenient(stream: Any, original: Any, descriptor: int) -> Any:
    """Return a stream that never raises, for the ``original`` stdout or stderr; others are returned unchanged."""
    if stream is None:
        return Path(os.devnull).open("w", encoding="utf-8")  # for the rest of the process
    if stream is not original or not isinstance(stream, TextIOWrapper):
        return stream
    file = BufferedWriter(_LenientFile(descriptor, "wb", closefd=False))
    return TextIOWrapper(
        file, stream.encoding, "paretoik.plain", line_buffering=stream.line_buffering or descriptor == STDERR
    )


def _check_written(stream: Any) -> None:
    """Flush a stream. Raises InvalidInput if a part was not written, unless the reader has left."""
    file = getattr(getattr(stream, "buffer", None), "raw", None)
    if not isinstance(file, _LenientFile):
        return
    stream.flush()
    if file.fault is not None and file.fault.errno != errno.EPIPE:
        raise InvalidInput(f"stdout: the output could not be written completely: {file.fault.strerror}")


def _plain_letters(error: UnicodeError) -> tuple[str, int]:
    assert isinstance(error, UnicodeEncodeError)
    letters = unicodedata.normalize("NFKD", error.object[error.start : error.end])
    plain = letters.translate(PLAIN).encode("ascii", "replace")
    return plain.decode(), error.end


# Arguments, results, messages and exit codes of sub-commands.


JsonFlag = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
QuietFlag = Annotated[bool, typer.Option("--quiet", help="Show no progress.")]
RunFolder = Annotated[Path, typer.Argument(help="Folder of a finished run.")]
EXIT_CODES = {  # by the status of a stopped run, or by what a command did not reach
    **{"time limit": 5, "SIGINT": 130, "interrupted": 130, "SIGTERM": 143},
    **{"no result": 6, "not verified": 7},
}


def exit_code(status: object) -> int:
    """Return the exit code of a run with a result, or of a command."""
    return EXIT_CODES.get(str(status), 0)


@contextmanager
def stdout_for_results() -> Iterator[None]:
    """Redirect stdout to stderr in the body, for users' functions and the programs that they start."""
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
def running(
    out: Path | None = None, *, quiet: bool, time_limit: float | None = None
) -> Iterator[Observer | Literal[False]]:
    """Yield the observer for a verb that the body runs; reserve stdout for the result.

    If a signal or the time limit ends it without a result, the error gets a note with the command that resumes the run.
    """
    with stdout_for_results(), open_observer(not quiet, time_limit=time_limit) as observe:
        try:
            yield observe or False
        except (KeyboardInterrupt, SystemExit, SolverFailed) as end:
            from paretoik.api.result_text import resume_command

            limited = not isinstance(end, SolverFailed) or time_limit is not None
            command = resume_command(out) if out is not None and limited else None
            if command is not None:
                end.add_note(f"{command} resumes it")
            raise


def print_json(value: object) -> None:
    """Print a result as strict JSON."""
    print(json.dumps(to_json(value), indent=2, allow_nan=False))


def finish_front(front: Front, out: Path, *, as_json: bool) -> NoReturn:
    """Print the front of a run as text or JSON, and exit with the code of the run's status."""
    from paretoik.api.result_text import entries, result_text, resume_command

    if as_json:
        gaps = {"jumps": front.jumps, "missing_hypervolume": front.missing_hypervolume}
        resume = resume_command(out, front.provenance["status"])
        print_json({**front.provenance, **gaps, "out": out, "resume": resume, "front": entries(front)})
    else:
        print_text(result_text(front, out))
    raise typer.Exit(exit_code(front.provenance["status"]))


def finish_plan(plan: Plan, name: str, unit: str, out: Path, *, as_json: bool) -> NoReturn:
    """Print the plan of an objective as text or JSON, and exit with the code of the run's status."""
    from paretoik.api.result_text import optima_entries, plan_text, resume_command

    if as_json:
        resume = resume_command(out, plan.provenance["status"])
        print_json({**plan.provenance, "out": out, "resume": resume, "optima": optima_entries(plan)})
    else:
        print_text(plan_text(plan, name, unit, out))
    raise typer.Exit(exit_code(plan.provenance["status"]))


def print_text(text: object) -> None:
    """Print a result on stdout, without control characters. Names may come from a file of unknown origin."""
    print("\n".join(map(_plain, str(text).split("\n"))))


def print_message(kind: str, style: str, text: str) -> None:
    """Print a message on stderr in one line, with its kind."""
    Console(stderr=True).print(Text.assemble((kind, style), " ", _one_line(text)), soft_wrap=True)


def print_error(text: str, error: BaseException) -> None:
    """Print an error and its notes on stderr, one line each."""
    print_message("error:", "bold red", text)
    for note in getattr(error, "__notes__", ()):
        print_message("note:", "yellow", note)


def has_agreed(question: str) -> bool:
    """Ask on the terminal; return whether the answer is yes, False without a terminal."""
    if not all(getattr(stream, "isatty", bool)() for stream in (sys.stdin, sys.stderr)):
        return False
    print(f"{_one_line(question)} [y/N] ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() in ("y", "yes")


def _one_line(text: str) -> str:
    """Return text as one line without control characters."""
    return _plain(" ".join(filter(None, map(str.strip, text.splitlines()))))


def _plain(line: str) -> str:
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in line)


# The options that several sub-commands share.


SolverName: TypeAlias = Literal["auto", "interior-point", "sqp"]
Problem = Annotated[str, typer.Argument(help="FILE.py:NAME or package.module:NAME")]
RunProblem = Annotated[
    str | None,
    typer.Option(
        "--problem",
        help="Problem of the run; its file is run. On a terminal you are asked whether to use the one that the run "
        "names.",
        metavar="FILE.py:NAME",
    ),
]
OutFolder = Annotated[Path, typer.Option(help="Folder to keep the run in.")]
Starts = Annotated[int | None, typer.Option(help="Number of starts per redundant degree (up to 48, if they help).")]
Seed = Annotated[int, typer.Option(help="Seed of all random numbers.")]
SolverOption = Annotated[
    SolverName, typer.Option(help="Interior points (smooth functions), SQP by Clarabel (any), or what suits.")
]
TimeLimit = Annotated[float | None, typer.Option(help="Computing time [s] after which to stop and keep the result.")]
Workers = Annotated[int | None, typer.Option(help="Number of processes on this machine that compute (only this one).")]
ClusterAddress = Annotated[
    str | None, typer.Option("--cluster", help="Dask scheduler whose workers compute.", metavar="tcp://HOST:PORT")
]
Live = Annotated[
    bool, typer.Option("--live", help="Open a viewer on the run; without a screen, say how to attach one.")
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace a run in the folder, once there is a result.")]


def agreed_problem(run: Path, problem: str | None, *, needed: bool = False) -> str | None:
    """Return ``--problem``, the problem that the run names, or None.

    The problem that the run names is returned only if the user agrees, on a terminal, to run its code. Raises
    InvalidInput, with a command that names the problem, if it is ``needed`` and the user did not agree.
    """
    reference = read_run(run / RUN).get("problem") if problem is None and is_run(run / RUN) else None
    words = problem_words(reference)
    if not words:
        return problem
    place = words[1].rpartition(":")[0]
    code = Path.cwd() / place if place.endswith(".py") else place
    if has_agreed(f"{run} is a run of {words[1]}. Run the code of {code}?"):
        return words[1]
    if needed:
        command = shell_command("paretoik", *sys.argv[1:], *words)
        raise InvalidInput(f"problem of {run} must be named, got none; its file is run only then: {command}")
    return None

"""What sub-commands share: arguments, results on stdout, messages on stderr, and exit codes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer
from rich.console import Console
from rich.text import Text

if TYPE_CHECKING:
    from paretoik.front.front import Front

JsonFlag = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
QuietFlag = Annotated[bool, typer.Option("--quiet", help="No progress.")]
RunFolder = Annotated[Path, typer.Argument(help="Folder of a finished run.", show_default=False)]
EXIT_CODES = {"time limit": 5, "SIGINT": 130, "interrupted": 130, "SIGTERM": 143}


def exit_code(status: object) -> int:
    """Return the exit code of a run that kept its result, by what ended it."""
    return EXIT_CODES.get(str(status), 0)


def print_json(value: object) -> None:
    """Print a result as strict JSON."""
    from paretoik.run_files import to_json

    print(json.dumps(to_json(value), indent=2, allow_nan=False))


def finish_front(front: Front, out: Path, *, as_json: bool) -> NoReturn:
    """Print the front of a run that ended, as text or JSON, and exit with the code of what ended it."""
    from paretoik.api.result_text import entries, result_text

    if as_json:
        gaps = {"jumps": front.jumps, "missing_hypervolume": front.missing_hypervolume}
        print_json({**front.provenance, **gaps, "out": out, "front": entries(front)})
    else:
        print(result_text(front, out))
    raise typer.Exit(exit_code(front.provenance["status"]))


def print_message(kind: str, style: str, text: str) -> None:
    """Print a message on stderr, as one line that starts with its kind."""
    Console(stderr=True).print(Text.assemble((kind, style), " ", " ".join(text.split())), soft_wrap=True)

"""``paretoik show``: open the recording of a run in the Rerun viewer, on a motion of its front."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from paretoik.cli.console import RunFolder, RunProblem, agreed_problem
from paretoik.errors import InvalidInput
from paretoik.paths import missing_file, shell_command
from paretoik.runs.files import DRAWING, RECORDING, RUN, is_run, read_run


def show(
    run: RunFolder,
    point: Annotated[
        int | None,
        typer.Option(help="Open on the motion of this point instead of the present choice.", metavar="ID"),
    ] = None,
    compare: Annotated[
        int | None, typer.Option(help="Show the motion of another point next to it, on a common time.", metavar="ID")
    ] = None,
    problem: RunProblem = None,
) -> None:
    """Open the recording of a run in the Rerun viewer.

    It opens on the present choice of the run (paretoik select), or else on the search.
    """
    recording = run / RECORDING
    if not recording.is_file():
        raise InvalidInput(f"{recording} must be a recording, got {_contents(run)}")
    with tempfile.TemporaryDirectory(prefix="paretoik-show-") as folder:
        _open(recording, _with_choice(run, recording, Path(folder) / RECORDING, point, compare, problem))


def _contents(run: Path) -> str:
    """Return in words what a folder without a recording contains."""
    if not run.is_dir():
        return missing_file(run / RECORDING)
    holds = read_run(run / RUN).get("holds") if is_run(run / RUN) else None
    if holds is None:
        return "none; solve with --out to make one"
    picture = f"; its picture is {run / DRAWING}" if (run / DRAWING).is_file() else ""
    return f"a run that holds {holds}{picture}"


def _with_choice(
    run: Path, recording: Path, file: Path, point: int | None, compare: int | None, problem: str | None
) -> Path:
    """Return the recording if no point is given or chosen; else write and return one that opens on the point."""
    from paretoik.front.choice_tree import read_choices

    if point is None and compare is None and read_choices(run).chosen is None:
        return recording
    from paretoik.api.load import load_front
    from paretoik.formulations.protocol import is_loop
    from paretoik.front.choice_tree import pick_point
    from paretoik.front.preferences.compromise import compromise
    from paretoik.review.drawing.choice_layer import recording_with_choice

    front = load_front(run, agreed_problem(run, problem))
    if is_loop(front):
        if point is not None or compare is not None:
            raise InvalidInput(
                "point must come with a run that has a front, got a closed loop, whose only motion is shown"
            )
        return recording
    choice = pick_point(front, point, name="--point", otherwise=compromise)
    compared = None if compare is None else front[compare]
    file.write_bytes(recording_with_choice(front, choice, recording=recording, compare=compared))
    return file


def _open(recording: Path, file: Path) -> None:
    """Open a recording, or a copy of it, in the viewer and wait; raises InvalidInput if it does not start."""
    from paretoik.review.recording.viewer import run_viewer

    viewer = run_viewer(str(file.absolute()))  # without a screen it ends with an error
    if viewer.returncode != 0:
        # The last line ends with the cause.
        message = (viewer.stderr.strip().splitlines() or [f"exit status {viewer.returncode}"])[-1].rsplit(": ", 1)[-1]
        raise InvalidInput(
            f"{recording} must open in the Rerun viewer, got {message!r}; without a screen, "
            f"copy the file to a machine that has one, or run: "
            f"{shell_command('rerun', '--serve-web', '--bind', '127.0.0.1', recording)}"
        )

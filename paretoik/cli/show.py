"""``paretoik show``: open the recording of a run in the Rerun viewer."""

from __future__ import annotations

from paretoik.cli.console import RunFolder
from paretoik.errors import InvalidInput
from paretoik.run_files import RECORDING


def show(run: RunFolder) -> None:
    """Open the recording of a run in the Rerun viewer."""
    recording = run / RECORDING
    if not recording.is_file():
        raise InvalidInput(f"{recording}: wanted a recording, got nothing; solve with out= to make one")
    from paretoik.review.viewer import run_viewer

    viewer = run_viewer(str(recording))  # without a screen it ends with an error
    if viewer.returncode != 0:
        # The last line ends with the cause.
        message = (viewer.stderr.strip().splitlines() or [f"exit status {viewer.returncode}"])[-1].rsplit(": ", 1)[-1]
        raise InvalidInput(
            f"{recording}: wanted to open it in the Rerun viewer, got {message!r}; without a screen, "
            f"copy the file to a machine that has one, or run: rerun --serve-web --bind 127.0.0.1 {recording}"
        )

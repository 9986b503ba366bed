"""Opening a recording in the Rerun viewer."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from paretoik.errors import InvalidInput
from paretoik.run_files import RECORDING


def show(folder: Path | str) -> None:
    """Open the recording of the run in `folder` and wait until the viewer is closed.

    The viewer listens on this machine only, on a port that is free, and sends no usage statistics.

    Raises
    ------
    InvalidInput
        There is no recording, Rerun is not installed, or its viewer ended with an error, as it does without a screen.
    """
    recording = Path(folder) / RECORDING
    if not recording.is_file():
        raise InvalidInput(f"{recording}: wanted a recording, got nothing; solve with out= to make one")
    command = [sys.executable, "-m", "rerun", str(recording), "--bind", "127.0.0.1", "--port", "auto"]
    viewer = subprocess.run(
        command,
        env=os.environ | {"RERUN_ANALYTICS": "0"},
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        check=False,
    )
    if viewer.returncode != 0:
        # The last line ends with the cause.
        message = (viewer.stderr.strip().splitlines() or [f"exit status {viewer.returncode}"])[-1].rsplit(": ", 1)[-1]
        raise InvalidInput(
            f"{recording}: wanted to open it in the Rerun viewer, got {message!r}; without a screen, "
            f"copy the file to a machine that has one, or run: rerun --serve-web --bind 127.0.0.1 {recording}"
        )

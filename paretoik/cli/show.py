"""``paretoik show``: open the recording of a run in the Rerun viewer."""

from __future__ import annotations

import os
import subprocess
import sys

from paretoik.cli.console import RunFolder
from paretoik.errors import InvalidInput
from paretoik.run_files import RECORDING


def show(run: RunFolder) -> None:
    """Open the recording of a run in the Rerun viewer."""
    recording = run / RECORDING
    if not recording.is_file():
        raise InvalidInput(f"{recording}: wanted a recording, got nothing; solve with out= to make one")
    # The viewer listens on this machine only, on a free port; without a screen it ends with an error.
    command = [sys.executable, "-m", "rerun", str(recording), "--bind", "127.0.0.1", "--port", "auto"]
    env = os.environ | {"RERUN_ANALYTICS": "0"}  # no usage statistics
    viewer = subprocess.run(command, env=env, stderr=subprocess.PIPE, text=True, errors="replace", check=False)
    if viewer.returncode != 0:
        # The last line ends with the cause.
        message = (viewer.stderr.strip().splitlines() or [f"exit status {viewer.returncode}"])[-1].rsplit(": ", 1)[-1]
        raise InvalidInput(
            f"{recording}: wanted to open it in the Rerun viewer, got {message!r}; without a screen, "
            f"copy the file to a machine that has one, or run: rerun --serve-web --bind 127.0.0.1 {recording}"
        )

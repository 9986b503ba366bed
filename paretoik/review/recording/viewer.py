"""The Rerun viewer, a separate program: only for this machine, and without its telemetry.

``python -m paretoik.review.recording.viewer FILE-OR-ADDRESS`` opens it and waits for it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def private_environment() -> Iterator[dict[str, str]]:
    """Yield the environment for Rerun's programs, with a temporary folder for their data.

    Rerun's programs send usage statistics unless a complete configuration disables it (RERUN_ANALYTICS belongs to
    another version). If the user's home has no such files, they write a configuration and window settings there.
    """
    with tempfile.TemporaryDirectory(prefix="paretoik-viewer-") as name:
        folder = Path(name)
        settings = {
            "analytics_enabled": False,
            "analytics_id": "",
            "metadata": {},
            "config_file_path": str(folder / "rerun" / "analytics.json"),
            "data_dir_path": str(folder / "analytics"),
        }
        for each in ("rerun", "analytics"):
            (folder / each).mkdir()
        (folder / "rerun" / "analytics.json").write_text(json.dumps(settings), encoding="utf-8")
        environment = {name: value for name, value in os.environ.items() if name != "FORCE_RERUN_ANALYTICS"}
        folders = dict.fromkeys(("XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME"), name)
        yield environment | folders


def run_viewer(target: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Open a file or address in the viewer with its own options, and return after it is closed."""
    # By default the viewer listens to all machines, on a port that may be taken. -P ignores a rerun.py in the current
    # folder, which may be anybody's run.
    command = [sys.executable, "-P", "-m", "rerun", target, "--bind", "127.0.0.1", "--port", "auto", *options]
    with private_environment() as environment:
        return subprocess.run(
            command, env=environment, stderr=subprocess.PIPE, text=True, errors="replace", check=False
        )


def main(arguments: Sequence[str]) -> int:
    """Open the file or address in the arguments; return the viewer's exit status."""
    return run_viewer(*arguments).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

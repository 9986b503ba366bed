"""The Rerun viewer, a program of its own: on this machine alone, and without its telemetry.

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
    """Yield the environment for Rerun's programs, with a folder of their own for what they keep while the body runs.

    They send usage statistics unless a complete configuration says no (RERUN_ANALYTICS is another version's), and write
    one, and what they remember of windows, into the user's home where they find none.
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
    """Open a file or address in the viewer with options of its own, and return when it has been closed."""
    # It would listen to all the world, and on a port that may be taken; -P: a rerun.py in the current folder, which may
    # be a run from anybody, is not what is meant.
    command = [sys.executable, "-P", "-m", "rerun", target, "--bind", "127.0.0.1", "--port", "auto", *options]
    with private_environment() as environment:
        return subprocess.run(
            command, env=environment, stderr=subprocess.PIPE, text=True, errors="replace", check=False
        )


def main(arguments: Sequence[str]) -> int:
    """Open what the arguments name, and return the viewer's exit status."""
    return run_viewer(*arguments).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""The child processes of a process, and whether they have ended."""

from __future__ import annotations

import time
from pathlib import Path

import pytest


def children(pid: int) -> list[int]:
    """Return the children of a process; skips if the system does not list them."""
    listing = Path(f"/proc/{pid}/task/{pid}/children")
    if not listing.exists():
        pytest.skip("the system does not list the children of a process")
    return [int(child) for child in listing.read_text().split()]


def wait_for_end(pid: int, *, seconds: float = 60.0) -> None:
    """Wait until a process has ended, even if its status was never read."""
    status = Path(f"/proc/{pid}/stat")
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        try:
            if status.read_text().rpartition(")")[2].split()[0] == "Z":
                return
        except OSError:
            return
        time.sleep(0.05)
    pytest.fail(f"process {pid} is still running")

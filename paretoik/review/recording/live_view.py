"""A view of a running run: a server for this machine only, and a viewer if there is a screen.

The server is the recording's own, so a viewer may come late, hang or be killed: the recording never waits for it.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import rerun as rr

LOOPBACK = "127.0.0.1"


@dataclass(frozen=True, kw_only=True)
class LiveOptions:
    """Memory of the server for late viewers, and waiting times at the end."""

    memory: str = "200MB"  # of the server
    opening: float = 6.0  # waiting time for a viewer that was just started [s]
    reading: float = 1.0  # waiting time for a viewer that already runs [s]


OPTIONS = LiveOptions()


class LiveView:
    """Serves recordings to viewers on this machine, and opens one; ``tell`` gets a line on how to open another."""

    def __init__(self, tell: Callable[..., None]) -> None:
        self._tell = tell
        self._stream = rr.RecordingStream("server", send_properties=False)
        server = rr.GrpcServerSink(bind_ip=LOOPBACK, port=_free_port(), server_memory_limit=OPTIONS.memory)
        self._stream.set_sinks(server)
        self._address = server.uri
        self._opened = time.monotonic()
        self._viewer = _open_viewer(self._address) if has_screen() else None
        if self._viewer is None:
            self._tell(notice=f"live, without a screen: {self._advice}")

    def sink(self) -> rr.GrpcSink:
        """Return the additional sink of a recording."""
        return rr.GrpcSink(self._address)

    def look_after(self) -> None:
        """Give a notice if our viewer did not open."""
        if self._viewer is not None and self._viewer.poll() is not None:
            if self._viewer.returncode != 0:
                self._tell(notice=f"live, but the viewer did not open: {self._advice}")
            self._viewer = None

    def close(self) -> None:
        """Stop serving after viewers have had time to read the last data."""
        if self._viewer is not None and self._viewer.poll() is None:
            time.sleep(max(self._opened + OPTIONS.opening - time.monotonic(), 0.0))
        time.sleep(OPTIONS.reading)
        self._stream.disconnect()

    @property
    def _advice(self) -> str:
        return f"watch the run by `rerun {self._address}` on this machine"


def has_screen() -> bool:
    """Return whether a window can be opened."""
    return sys.platform in ("darwin", "win32") or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def _open_viewer(address: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-P", "-m", "paretoik.review.recording.viewer", address]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])

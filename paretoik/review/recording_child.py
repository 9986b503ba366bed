"""The process that records, started by ``RecordingProcess``.

It reads messages from stdin and answers on stdout, one line of JSON per message. If its parent ends for any reason,
it completes the file with the data that it has, and ends too.

A drawing shows all kept messages and the end, on common axes. The run is drawn again and again while it lasts, if that
takes a small share of the time, and once at its end; each drawing replaces the file.
"""

from __future__ import annotations

import errno
import json
import os
import pickle
import re
import select
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.drawing.capability_drawing import MaximaDrawing, PathDrawing
from paretoik.review.drawing.layout import RecordedLayout, stream_in_memory
from paretoik.review.drawing.plan_drawing import PlanDrawing
from paretoik.review.drawing.search_drawing import FrontReduction, SearchDrawing
from paretoik.review.drawing.step_drawing import LoopDrawing, ResolutionDrawing
from paretoik.review.recording.messages import MaximaScene, PathScene, PlannedScene, ResolvedScene
from paretoik.review.recording.recorder import (
    HEADER,
    OPTIONS,
    Opening,
    SearchedFront,
    SearchEnd,
    cause_of,
)
from paretoik.runs.file_replacement import replace_file

# The file of a recording: when it is drawn, and which messages of a long run are kept.


DRAWINGS: dict[type, Any] = {  # by type of scene; their fields are scene, messages, end and note
    SearchedFront: SearchDrawing,
    PlannedScene: PlanDrawing,
    ResolvedScene: ResolutionDrawing,
    MaximaScene: MaximaDrawing,
    PathScene: PathDrawing,
}


class RecordingFile:
    """The file of a recording in progress; its methods raise the errors of Rerun and of the disk.

    stride: of a series, every ``stride``-th message is kept, including the first and the last
    dropped: number of messages that were not kept
    """

    def __init__(self, opening: Opening, tell: Callable[..., None]) -> None:
        rr.set_strict_mode(True)  # a row that cannot be drawn is an error, not a line in an unread log
        self.stride, self.dropped = 1, 0
        self._opening, self._options, self._file = opening, opening.options, Path(opening.file)
        # The viewer keeps one layout per application, and each run needs its own.
        application = f"{opening.title} in {self._file.resolve().parent.name}"
        self._application = re.sub(r"[^A-Za-z0-9_-]+", "-", application).strip("-")
        self._messages: list[Any] = []
        self._reduce: Callable[[Any], Any] = lambda message: message
        if isinstance(opening.scene, SearchedFront):
            reduction = FrontReduction(maximised=opening.scene.maximised, points=self._options.points)
            self._reduce = reduction.reduce
        self._live = LiveView(self._application, tell) if opening.live else None
        if self._run_lives():
            self._file.unlink(missing_ok=True)
        self._file.open("x").close()  # it must not exist: another run may have begun there
        self._stamp = _stamp(self._file)
        self._is_drawn, self._next = True, 0.0  # whether all messages are drawn; time of the next drawing

    def record(self, message: Any) -> None:
        """Keep a message, reduced to the parts that are drawn."""
        self._messages.append(self._reduce(message))
        self._keep()
        self._is_drawn = False

    def look_after(self) -> None:
        """Draw the run so far if a drawing is due."""
        if not self._is_drawn and time.monotonic() > self._next:
            started = time.monotonic()
            self._draw(None)
            self._next = time.monotonic() + (time.monotonic() - started) / self._options.share
        if self._live is not None:
            self._live.look_after()

    def complete(self, end: Any, dropped: int = 0) -> None:
        """Draw everything with its ``end``, and close the file; ``dropped``: number of messages not sent."""
        self.dropped += dropped
        self._draw(end)
        self.close()

    def close(self) -> None:
        """Close the live view, if any."""
        if self._live is not None:
            live, self._live = self._live, None
            live.close()

    def _draw(self, end: Any) -> None:
        """Replace the file by a drawing; drop messages while it is too large for its limit or the disk."""
        content, room = self._content(end), min(self._options.size, shutil.disk_usage(self._file.parent).free)
        while len(content) > room and len({each.number for each in self._series()}) > 2:
            self.stride *= 2
            if self._keep():
                content = self._content(end)

        def check(_: Path) -> None:
            if _stamp(self._file) != self._stamp and not self._run_lives():
                raise FileExistsError(errno.EEXIST, "another run is writing it")

        replace_file(self._file, bytes(content), check=check)
        self._stamp, self._is_drawn = _stamp(self._file), True
        if self._live is not None:
            self._live.show(self._file)

    def _run_lives(self) -> bool:
        """Return whether the run lives; after its death a resumed run may write the same file."""
        return os.getppid() == self._opening.run

    def _content(self, end: Any) -> bytearray:
        """Return the file of the kept messages and the ``end``."""
        opening, kept = self._opening, len(self._series())
        with stream_in_memory(self._application, self._options.batch) as (stream, content):
            stream.send_recording_name(opening.title)
            if self._messages or end is not None:
                kind, note = getattr(opening.scene, "timeline", "message"), ""
                if self.dropped:
                    note = f"The run was long: {kept} of its {kept + self.dropped} {kind}s are kept here."
                drawing = LoopDrawing if kind == "step" else DRAWINGS[type(opening.scene)]
                if end is None and isinstance(opening.scene, SearchedFront):
                    end = SearchEnd(front=None)  # the last generation is the end
                drawing(scene=opening.scene, messages=tuple(self._messages), end=end, note=note).log(stream)
            else:
                words = rr.TextDocument("The run ended before there was anything to show.")
                stream.log("text", words, static=True)
                view = rrb.TextDocumentView(origin="text", name="nothing")
                stream.send_blueprint(rrb.Blueprint(view, auto_views=False))
        return content

    def _keep(self) -> int:
        """Keep only every ``stride``-th message of the series and the last; return how many were dropped."""
        series, count = self._series(), len(self._messages)
        self._messages = [
            each
            for each in self._messages
            if not hasattr(each, "number") or each is series[-1] or (each.number - series[0].number) % self.stride == 0
        ]
        dropped = count - len(self._messages)
        self.dropped += dropped
        return dropped

    def _series(self) -> list[Any]:
        return [each for each in self._messages if hasattr(each, "number")]


def _stamp(file: Path) -> tuple[int, int]:
    """Return inode and modification time [ns], which identify a version of a file."""
    status = file.lstat()
    return status.st_ino, status.st_mtime_ns


# A view of a running run: a server for this machine only, and a viewer if there is a screen.
#
# The recording has its own server and never waits for a viewer, which may come late, hang or be killed.


LOOPBACK = "127.0.0.1"


@dataclass(frozen=True, kw_only=True)
class LiveOptions:
    """Memory of the server for late viewers, and waiting times at the end."""

    memory: str = "200MB"  # of the server
    opening: float = 6.0  # waiting time for a viewer that was just started [s]
    reading: float = 1.0  # waiting time for a viewer that already runs [s]


LIVE = LiveOptions()


class LiveView:
    """Serves a recording to viewers on this machine and opens one; ``tell`` gets a line on how to open it."""

    def __init__(self, application: str, tell: Callable[..., None]) -> None:
        self._tell, self._views = tell, 0
        self._stream = rr.RecordingStream(application, send_properties=False)
        with socket.socket() as probe:
            probe.bind((LOOPBACK, 0))
            port = int(probe.getsockname()[1])
        server = rr.GrpcServerSink(bind_ip=LOOPBACK, port=port, server_memory_limit=LIVE.memory)
        self._stream.set_sinks(server)
        self._address, self._opened = server.uri, time.monotonic()
        self._viewer: subprocess.Popen[bytes] | None = None
        if sys.platform in ("darwin", "win32") or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")):
            command = [sys.executable, "-P", "-m", "paretoik.review.recording.viewer", self._address]
            self._viewer = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True
            )
        else:
            self._tell(notice=f"live, without a screen: {self._advice}")

    def show(self, file: Path) -> None:
        """Show the present content of a recording, and its layout if its views changed."""
        reader = rr.chunk.RrdReader(file)
        (recording,), (layout,) = reader.recordings(), reader.blueprints()
        self._stream.send_chunks(reader.stream(store=recording))
        if (views := len(reader.stream(store=layout).to_chunks())) != self._views:
            self._views = views
            self._stream.send_blueprint(RecordedLayout(reader.stream(store=layout)), make_active=True)

    def look_after(self) -> None:
        """Give a notice if our viewer did not open."""
        if self._viewer is not None and self._viewer.poll() is not None:
            if self._viewer.returncode != 0:
                self._tell(notice=f"live, but the viewer did not open: {self._advice}")
            self._viewer = None

    def close(self) -> None:
        """Stop serving after viewers have had time to read the last data."""
        if self._viewer is not None and self._viewer.poll() is None:
            time.sleep(max(self._opened + LIVE.opening - time.monotonic(), 0.0))
        time.sleep(LIVE.reading)
        self._stream.disconnect()

    @property
    def _advice(self) -> str:
        return f"watch the run by `rerun {self._address}` on this machine"


def main() -> None:
    """Record the parent's messages until the recording or the parent ends."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):  # the run decides, and may still finish the file
        signal.signal(number, signal.SIG_IGN)
    with suppress(OSError):
        os.nice(OPTIONS.niceness)
    source, answers = os.dup(0), os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # other prints must not be read as answers

    def tell(**answer: Any) -> None:
        """Send an answer to the parent process, if it still reads."""
        with suppress(OSError, ValueError):
            print(json.dumps(answer), file=answers, flush=True)

    received, recording = messages(source, os.getppid()), None
    try:
        for message in received:
            if message is not None and message[0] == "end" and recording is not None:
                recording.complete(*message[1:])
                tell(finished=True)
                return
            if message is not None and message[0] == "open":
                Path(message[1].file).unlink(missing_ok=True)
                recording = RecordingFile(message[1], tell)
            elif message is not None and recording is not None:
                recording.record(message[1])
            if message is not None:
                tell(done=1)
            if recording is not None:
                recording.look_after()
        if recording is not None:  # the parent is gone
            recording.complete(None)
    except Exception as fault:
        tell(failed=cause_of(fault.__cause__ or fault))
        sys.exit(1)
    finally:
        if recording is not None:
            recording.close()


def messages(source: int, parent: int) -> Iterator[tuple[str, Any, int] | None]:
    """Yield kind, message and the number of dropped messages as they arrive, until the parent is gone."""
    part = bytearray()
    while True:
        if len(part) >= HEADER and len(part) >= HEADER + (length := int.from_bytes(part[:HEADER])):
            content = bytes(part[HEADER : HEADER + length])
            del part[: HEADER + length]
            yield pickle.loads(content)
            continue
        if not select.select([source], [], [], OPTIONS.tick)[0]:
            yield None
            if os.getppid() != parent:  # the parent is gone, but a fork of it holds the pipe open
                return
            continue
        piece = os.read(source, 1 << 20)
        if not piece:
            return
        part += piece

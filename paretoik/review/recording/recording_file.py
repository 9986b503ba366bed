"""The file of a recording: what is kept of a run that may be long, when it is written, and how it ends.

During the run each message is drawn as it comes. At the end all kept messages are drawn again, on common axes, into a
second file that then replaces the first. If the file grows too large during the run, every second message of a series
is dropped and the rest is written again.
"""

from __future__ import annotations

import errno
import os
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.recording.live_view import LiveView
from paretoik.review.recording.recorder import Opening, RecorderOptions, part_of


@runtime_checkable
class Drawing(Protocol):
    """All kept messages of a run, its end (None if it has none), and a note if any."""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything, on common axes."""


@runtime_checkable
class LiveDrawing(Protocol):
    """Draws messages as they come; there is one per file."""

    def reduce(self, message: Any) -> Any:
        """Return what to keep of a message, which may be large."""

    def record(self, message: Any) -> None:
        """Draw a message."""


@dataclass(frozen=True, kw_only=True)
class SceneDrawing:
    """How a kind of scene is drawn: at the end, and if it can be watched, during the run.

    ``whole`` is called with ``scene``, ``messages``, ``end`` and ``note``.
    """

    whole: Callable[..., Drawing]
    live: Callable[[Any, rr.RecordingStream, RecorderOptions], LiveDrawing] | None = None


@runtime_checkable
class Parent(Protocol):
    """The process that waits for the recording."""

    def tell(self, **answer: Any) -> None:
        """Send a notice."""

    def beat(self) -> None:
        """Report that work continues."""


class Stream(rr.RecordingStream):
    """A stream that reports every call of its log methods."""

    def __init__(self, application: str, beat: Callable[[], None], batch: int) -> None:
        # Many small chunks make large files: logged data are flushed explicitly, or at a number of bytes.
        batcher = rr.ChunkBatcherConfig(flush_tick=3600.0, flush_num_bytes=batch)
        super().__init__(application, batcher_config=batcher)
        self._beat = beat

    def log(self, *arguments: Any, **settings: Any) -> None:
        """Log as any stream does."""
        self._beat()
        super().log(*arguments, **settings)

    def send_columns(self, *arguments: Any, **settings: Any) -> None:
        """Send columns as any stream does."""
        self._beat()
        super().send_columns(*arguments, **settings)


class RecordingFile:
    """The file of a recording in progress; errors of Rerun and of the disk are raised.

    Every ``stride``-th message of a series is kept, including the first and the last.
    """

    def __init__(self, opening: Opening, parent: Parent, drawing: SceneDrawing) -> None:
        rr.set_strict_mode(True)  # a row that cannot be drawn is an error, not a line in an unread log
        self.stride = 1
        self._opening, self._options, self._parent, self._scene = opening, opening.options, parent, drawing
        self._file = Path(opening.file)
        self._messages: list[Any] = []
        self._last: Any = None  # message of the series
        self._first = 0
        self._live = LiveView(parent.tell) if opening.live else None
        # The recorder of a killed run may begin late or still be at work; it must not touch a newer run's file.
        if _is_alive(opening.run):
            self._file.unlink(missing_ok=True)
        # While it is open no other file has its inode.
        self._written: int | None = _create(self._file)
        self._stream, self._drawing = self._open(self._written)
        self._flushed, self._size = time.monotonic(), 0
        self._pending, self._growth = 0, float(self._options.reserve)  # unwritten messages, most bytes per message

    def record(self, message: Any, stride: int = 1) -> None:
        """Draw a message and keep it; the sender keeps every ``stride``-th of the series."""
        self.stride = max(self.stride, stride)
        if self._drawing is not None:
            message = self._drawing.reduce(message)
        number = _number(message)
        if number is not None:
            self._first = number if self._last is None else self._first
            self._last = message
        self._messages.append(message)
        self._pending += 1
        if self._drawing is not None:
            self._drawing.record(message)

    def look_after(self) -> None:
        """Write pending data, and thin a series that is too long, if it is time."""
        much = 4 * self._pending * self._growth > self._options.reserve
        if not much and time.monotonic() - self._flushed < self._options.flush:
            return
        self._flush()
        if self._size > self._options.size and self._thin():
            self._replace(self._draw_again)
            self._flush()
        if self._live is not None:
            self._live.look_after()

    def complete(self, end: Any, stride: int = 1) -> None:
        """Draw everything again with its ``end``, and close the file; ``stride`` as for ``record``."""
        self.stride = max(self.stride, stride)
        self._keep(self.stride)
        self._replace(lambda: self._draw_whole(end))
        self.close()

    def close(self) -> None:
        """Close the file as it is."""
        self._stream.disconnect()
        if self._written is not None:
            os.close(self._written)
            self._written = None
        if self._live is not None:
            live, self._live = self._live, None
            live.close()

    def _open(self, file: int) -> tuple[rr.RecordingStream, LiveDrawing | None]:
        """Begin to record into an open file, even if it was renamed, and return what draws messages into it."""
        # The viewer keeps one layout per application, and each run needs its own.
        application = f"{self._opening.title} in {self._file.resolve().parent.name}"
        name = re.sub(r"[^A-Za-z0-9_-]+", "-", application).strip("-")
        stream = Stream(name, self._parent.beat, self._options.batch)
        stream.set_sinks(rr.FileSink(f"/dev/fd/{file}"), *(() if self._live is None else (self._live.sink(),)))
        stream.send_recording_name(self._opening.title)
        live = self._scene.live
        return stream, None if live is None else live(self._opening.scene, stream, self._options)

    def _draw_again(self) -> None:
        if self._drawing is not None:
            for message in self._messages:
                self._drawing.record(message)

    def _draw_whole(self, end: Any) -> None:
        if self._messages or end is not None:
            whole = self._scene.whole(
                scene=self._opening.scene, messages=tuple(self._messages), end=end, note=self._note()
            )
            whole.log(self._stream)
        else:
            words = rr.TextDocument("The run ended before there was anything to show.")
            self._stream.log("text", words, static=True)
            view = rrb.TextDocumentView(origin="text", name="nothing")
            self._stream.send_blueprint(rrb.Blueprint(view, auto_views=False))

    def _replace(self, draw: Callable[[], None]) -> None:
        """Replace the present file with a new one that ``draw`` makes; the present one is complete until then."""
        self._stream.disconnect()
        self._check_space(self._file.stat().st_size)
        part = part_of(self._file, self._opening.run)
        part.unlink(missing_ok=True)  # left by a killed process, or a link
        written = _create(part)
        try:
            self._stream, self._drawing = self._open(written)
            draw()
            self._check_space(0)
            self._stream.flush()
            if self._written is None or not (_is_at(self._file, self._written) and _is_at(part, written)):
                raise FileExistsError(errno.EEXIST, "another run writes it")
            part.replace(self._file)
            self._written, written = written, self._written
        finally:
            os.close(written)
            part.unlink(missing_ok=True)

    def _flush(self) -> None:
        """Write pending data, and measure the size of a message."""
        self._check_space(0)
        self._stream.flush()
        size = self._file.stat().st_size
        if self._pending:
            self._growth = max((size - self._size) / self._pending, 0.0)
        self._flushed, self._size, self._pending = time.monotonic(), size, 0

    def _thin(self) -> bool:
        """Drop at least every second message of the series, except the last; return whether any was dropped."""
        while len({_number(message) for message in self._messages} - {None}) > 2:
            self.stride *= 2
            if self._keep(self.stride):
                return True
        return False

    def _keep(self, stride: int) -> bool:
        """Drop all of the series except every ``stride``-th message and the last; return whether any was dropped."""
        count = len(self._messages)
        self._messages = [
            message
            for message in self._messages
            if (number := _number(message)) is None or message is self._last or (number - self._first) % stride == 0
        ]
        return len(self._messages) < count

    def _note(self) -> str:
        """Return in words what was thinned."""
        if self.stride == 1:
            return ""
        kind = getattr(self._opening.scene, "timeline", "message")
        return f"The run was long: one in {self.stride} of its {kind}s is kept here, the last one too."

    def _check_space(self, needed: int) -> None:
        """Raise OSError if ``needed`` bytes would fill the disk: Rerun may hang on a full one."""
        disk = os.statvfs(self._file.parent)
        if disk.f_bavail * disk.f_frsize < needed + self._options.reserve:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _create(file: Path) -> int:
    """Return the descriptor of a new file; raises FileExistsError if its name is taken, even by a link."""
    return os.open(file, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)


def _is_at(file: Path, descriptor: int) -> bool:
    """Return whether an open file still has its name."""
    return os.path.samestat(file.lstat(), os.fstat(descriptor))


def _number(message: Any) -> int | None:
    """Return the number of a message in its series, None if it belongs to none."""
    number: int | None = getattr(message, "number", None)
    return number


def _is_alive(process: int) -> bool:
    """Return whether a process is alive; another user's process counts as alive."""
    try:
        os.kill(process, 0)
    except OSError as fault:
        return fault.errno == errno.EPERM
    return True

"""Recordings that are drawn completely at their end, from few messages or none."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any, ClassVar, Protocol, runtime_checkable

import rerun as rr
import rerun.blueprint as rrb

from paretoik.review.drawing.layout import TEXT_ENTITY as TEXT
from paretoik.review.drawing.layout import text_view
from paretoik.review.recording.recorder import RecorderOptions


@runtime_checkable
class WholeScene(Protocol):
    """A scene that names the class, as "module:Class", that draws its messages and its end."""

    finished_by: ClassVar[str]


@runtime_checkable
class Finished(Protocol):
    """Messages and their end, ready to be drawn."""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""


class WholeRecording:
    """Draws a finished scene, however it ended; errors of Rerun are raised. See ``recording_file.Drawing``."""

    def __init__(self, scene: WholeScene, stream: rr.RecordingStream, options: RecorderOptions) -> None:
        self._scene, self._stream = scene, stream

    def reduce(self, message: Any) -> Any:
        """Return the message unchanged: there are few."""
        return message

    def record(self, message: Any) -> None:
        """Draw nothing yet: nobody is watching."""

    def finish(self, messages: Sequence[Any], end: Any, note: str) -> None:
        """Draw all messages with their end, if there is one, and a note if any."""
        if not messages and end is None:
            self._say_nothing()
            return
        module, _, name = self._scene.finished_by.partition(":")
        finished: Finished = getattr(import_module(module), name)(
            scene=self._scene, messages=tuple(messages), end=end, note=note
        )
        finished.log(self._stream)

    def _say_nothing(self) -> None:
        self._stream.log(TEXT, rr.TextDocument("The run ended before there was anything to show."), static=True)
        self._stream.send_blueprint(rrb.Blueprint(text_view("nothing"), auto_views=False))

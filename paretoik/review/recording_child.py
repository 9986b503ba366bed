"""The process that records, started by ``recording_process``.

It reads messages from stdin and answers on stdout, one line of JSON per message. It ends with its parent, however that
ends: then it completes the file with the data that it has.
"""

from __future__ import annotations

import json
import os
import pickle
import select
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from paretoik.review.recording.messages import MaximaScene, PathScene, PlannedScene, ResolvedScene
from paretoik.review.recording.recorder import HEADER, OPTIONS, Scene, SearchedFront, cause_of

if TYPE_CHECKING:
    from paretoik.review.recording.recording_file import RecordingFile, SceneDrawing


def drawing_of(scene: Scene) -> SceneDrawing:
    """Return what draws a scene."""
    # here: Rerun and drawings load slowly
    from paretoik.review.drawing.maxima_drawing import MaximaDrawing
    from paretoik.review.drawing.path_drawing import PathDrawing
    from paretoik.review.drawing.plan_drawing import PlanDrawing
    from paretoik.review.drawing.resolution_drawing import ResolutionDrawing
    from paretoik.review.drawing.search_drawing import LiveSearch, search_drawing
    from paretoik.review.recording.recording_file import SceneDrawing

    drawings: dict[type, SceneDrawing] = {
        SearchedFront: SceneDrawing(whole=search_drawing, live=LiveSearch),
        PlannedScene: SceneDrawing(whole=PlanDrawing),
        ResolvedScene: SceneDrawing(whole=ResolutionDrawing),
        MaximaScene: SceneDrawing(whole=MaximaDrawing),
        PathScene: SceneDrawing(whole=PathDrawing),
    }
    return drawings[type(scene)]


class Parent:
    """The run: its messages, and the answers to it."""

    def __init__(self) -> None:
        self._process = os.getppid()
        self._input = os.dup(0)
        self._answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
        os.dup2(2, 1)  # other prints are not answers
        self._last_answer = 0.0

    def messages(self) -> Iterator[tuple[str, Any, int] | None]:
        """Yield kind, message and the parent's stride as they arrive, until the parent is gone.

        Yield None if there was no message for a while.
        """
        part = bytearray()
        while True:
            if len(part) >= HEADER and len(part) >= HEADER + (length := int.from_bytes(part[:HEADER])):
                content = bytes(part[HEADER : HEADER + length])
                del part[: HEADER + length]
                yield pickle.loads(content)
                continue
            if not select.select([self._input], [], [], OPTIONS.tick)[0]:
                yield None
                if os.getppid() != self._process:  # if a fork of the parent still has its end of the pipe
                    return
                continue
            piece = os.read(self._input, 1 << 20)
            if not piece:
                return
            part += piece

    def tell(self, **answer: Any) -> None:
        """Answer, if the parent still listens."""
        self._last_answer = time.monotonic()
        with suppress(OSError, ValueError):
            print(json.dumps(answer), file=self._answers, flush=True)

    def beat(self) -> None:
        """Tell the parent from time to time that work continues."""
        if time.monotonic() - self._last_answer > 4 * OPTIONS.tick:
            self.tell()


def main() -> None:
    """Record the parent's messages until it ends the recording or itself."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):  # the run decides, and may still finish the file
        signal.signal(number, signal.SIG_IGN)
    with suppress(OSError):
        os.nice(OPTIONS.niceness)
    parent = Parent()
    try:
        _record(parent)
    except Exception as fault:
        parent.tell(failed=cause_of(fault))
        sys.exit(1)


def _record(parent: Parent) -> None:
    recording: RecordingFile | None = None
    try:
        for received in parent.messages():
            if recording is not None:
                recording.look_after()
            if received is None:
                continue
            kind, message, stride = received
            if kind == "open":
                from paretoik.review.recording.recording_file import RecordingFile

                recording = RecordingFile(message, parent, drawing_of(message.scene))
            elif recording is not None and kind == "record":
                recording.record(message, stride)
            elif recording is not None:
                recording.complete(message, stride)
                parent.tell(finished=True)
                return
            parent.tell(done=1, stride=1 if recording is None else recording.stride)
        if recording is not None:  # the parent is gone
            recording.complete(None)
    finally:
        if recording is not None:
            recording.close()

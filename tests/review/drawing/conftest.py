from __future__ import annotations

import os
import pickle
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
import rerun as rr

from paretoik.review.pictures import certificates, fronts, motions
from paretoik.review.recording import recorder
from paretoik.review.recording_child import RecordingFile


class RecordingHere:
    """Records in this process, because another one takes seconds to start."""

    def __init__(self, *_: Any) -> None:
        self.finished = self.stopped = False

    def send(self, kind: str, message: Any) -> None:
        sent = pickle.loads(recorder.pickle_message(message)[recorder.HEADER :])
        if kind == "open":
            self.file = RecordingFile(replace(sent, run=os.getppid()), lambda **_: None)
        else:
            self.file.record(sent)

    def complete(self, end: Any) -> None:
        self.file.complete(pickle.loads(recorder.pickle_message(end)[recorder.HEADER :]))
        self.finished = True

    def stop(self) -> None:
        self.stopped = True
        rr.set_strict_mode(False)


@pytest.fixture(scope="module", autouse=True)
def recording_here() -> Iterator[None]:
    """Record in this process, and draw no pictures of Matplotlib."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recorder, "RecordingProcess", RecordingHere)
        for module in (certificates, fronts, motions):
            for name in [name for name in vars(module) if name.endswith("_picture")]:
                patch.setattr(module, name, lambda *_: None)
        yield

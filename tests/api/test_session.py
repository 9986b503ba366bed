"""The folder of a run says what became of it, whatever happens."""

from __future__ import annotations

import json
import os
import signal

import numpy as np
import pytest

from paretoik.api.session import RunRequest, open_session
from paretoik.front.front import Front
from paretoik.review.recording.recorder import SearchedFront
from paretoik.runs.files import RUN
from tests.search.problems import Constant

SCENE = SearchedFront(names=("a",), units=("",), maximised=(False,))


def session(out, *, reference=None, **settings):
    arguments = {"verb": "solve", "settings": {"seed": 1}} | settings
    return open_session(RunRequest(problem=Constant(1), reference=reference, out=out, **arguments))


def front(provenance, value: float = 1.0) -> Front:
    return Front(
        ids=np.array([0]),
        objectives=np.array([[value]]),
        names=["a"],
        units=[""],
        maximised=[False],
        provenance=provenance,
    )


def stored(folder) -> dict:
    return json.loads((folder / RUN).read_text())


def test_a_failure_after_a_draft_keeps_the_draft(tmp_path):
    def work():
        with session(tmp_path) as run:
            run.save_draft(front({**run.provenance, "status": "generations"}, 3.0))
            raise RuntimeError("the lamp went out")

    with pytest.raises(RuntimeError):
        work()
    draft = Front.load(tmp_path)
    assert draft.objectives[0, 0] == 3.0
    assert (draft.provenance["status"], draft.provenance["reason"]) == ("RuntimeError", "the lamp went out")


def test_a_failure_after_the_end_leaves_the_front_as_it_is(tmp_path):
    def work():
        with session(tmp_path) as run:
            run.finish_front(front({**run.provenance, "status": "generations"}))
            raise RuntimeError("no ink for the picture")

    with pytest.raises(RuntimeError):
        work()
    assert Front.load(tmp_path).provenance["status"] == "generations"


def test_without_a_folder_nothing_is_written_and_signals_are_still_caught(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with session(None) as run:
        run.start_recording(SCENE)
        assert not run.is_watched
        assert run.signal is None
        os.kill(os.getpid(), signal.SIGTERM)
        assert run.signal == "SIGTERM"
        run.save_draft(front({}))
        run.finish_front(front({}))
    assert list(tmp_path.iterdir()) == []

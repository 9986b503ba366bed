from __future__ import annotations

import pytest

from paretoik.cli.results import show
from paretoik.errors import InvalidInput
from paretoik.runs.files import DRAWING, RECORDING, write_run


@pytest.fixture
def without_screen(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)


def test_a_viewer_that_finds_no_screen_says_what_to_do(without_screen, finished):
    with pytest.raises(InvalidInput, match=r"must open in the Rerun viewer, got .*; without a screen, copy"):
        show(finished)


def test_a_run_without_recording_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match=rf"{RECORDING} must be a recording, got none; solve with --out to make one"):
        show(tmp_path)


def test_a_run_of_something_else_without_recording_says_what_it_holds_and_where_its_picture_is(tmp_path):
    write_run(tmp_path, {"format": 1, "holds": "the optima of a plan, which load_plan opens"})
    with pytest.raises(InvalidInput, match=rf"{RECORDING} must be a recording, got a run that holds the optima of a"):
        show(tmp_path)
    (tmp_path / DRAWING).write_bytes(b"")
    with pytest.raises(InvalidInput, match=rf"which load_plan opens; its picture is {tmp_path / DRAWING}"):
        show(tmp_path)

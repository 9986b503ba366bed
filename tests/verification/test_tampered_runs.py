"""Edited runs with new digests: refused in one line when they are opened, or reported by the verifier."""

from __future__ import annotations

import json
import re
import warnings

import pytest

import paretoik as pk
from paretoik.errors import InvalidRun
from paretoik.runs.files import RUN, run_bytes
from studies.benchmarks.reliability.verifier import FAULTS, edit

OPENED = ("search", "certified", "plan", "closed loop")
QUICK = ("columns swapped", "times stretched", "not a number", "a motion missing")
OFF_THE_PATH = {
    "a joint off by 1e-6": r"motions must be on the path of the problem, got point \d+ \S+ m off it at sample 5 \(0.4",
    "columns swapped": r"motions must be on the path of the problem, got point \d+ 0\.\d+ m off it at sample",
    "names of joints swapped": r"motions must be on the path of the problem, got point \d+ 0\.\d+ m off it at sample",
    "a joint of another name": r"motions must have the joints joint1, joint2, joint3, got joint1, joint2, wrist",
    "times that go back": r"motions must have the times of the problem's path, got other times",
    "times stretched": r"motions must have the times of the problem's path, got other times",
    "a time shifted": r"motions must have the times of the problem's path, got other times",
    "a motion reversed": r"motions must be on the path of the problem, got point \d+ 0\.\d+ m off it at sample 0",
    "not a number": "must have finite q",
    "a motion missing": r"must have the ids of front.parquet, got array\(",
    "an id twice": "front ids must be unique",
    "a dominated point": "front points must be mutually non-dominated, got 1",
    "a jump in a loop": r"motions must be at a mean distance of \S+ m from the path, got \S+ m",
    "an error of a loop edited": r"motions must be at a mean distance of \S+ m from the path, got \S+ m",
}
"""Faults that are found without verifying, and their messages."""


def opened(folder, problem, kind):
    return pk.load_plan(folder, problem) if kind == "plan" else pk.load_front(folder, problem)


def names(*kinds):
    chosen = [name for name, (kind, *_) in FAULTS.items() if kind in kinds]
    return [pytest.param(name, marks=[] if name in QUICK else [pytest.mark.slow]) for name in chosen]


@pytest.mark.parametrize("fault", names(*OPENED))
def test_an_edited_run_is_opened_or_refused_in_a_line_and_motions_off_the_path_are_refused(good_run, tmp_path, fault):
    kind, change, _ = FAULTS[fault]
    folder, problem, _ = good_run(kind)
    edited = edit(folder, tmp_path / "edited", change)
    words = OFF_THE_PATH.get(fault)
    if words:
        with pytest.raises(pk.InvalidInput, match=words) as refused:
            opened(edited, problem, kind)
        assert "\n" not in str(refused.value)
        assert str(edited) in str(refused.value)
        return
    try:
        opened(edited, problem, kind)
    except pk.InvalidInput as refusal:
        assert "\n" not in str(refusal)  # noqa: PT017


def test_no_file_but_the_runs_own_is_read_where_it_is_edited(good_run, tmp_path):
    folder, problem, _ = good_run("search")
    edited = edit(folder, tmp_path / "edited", lambda run: run.entries["settings"].update(seed=2))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(pk.load_front(edited, problem)) == len(pk.load_front(folder, problem))
    content = json.loads((edited / RUN).read_text())
    for entries, words in (
        ({**content, "format": 2}, "must have format 1, got 2"),
        ({**content, "objectives": []}, "must have objectives and the digests"),
        ({**content, "objectives": content["objectives"][::-1]}, None),
        ({**content, "files": {**content["files"], "../escape": "0" * 64}}, "must have objectives and the digests"),
        ({**content, "holds": "a plan"}, "must be a run with a front, got one that contains a plan"),
    ):
        anew = {name: value for name, value in entries.items() if name not in ("format", "digest")}
        text = run_bytes(anew).decode()
        (edited / RUN).write_text(text.replace('"format": 1', f'"format": {entries["format"]}', 1))
        if words is None:
            assert pk.load_front(edited).names == ("torque_norm", "kinetic_energy")
            continue
        with pytest.raises(InvalidRun, match=words):
            pk.load_front(edited)


def test_numbers_that_strict_json_has_not_are_refused(good_run, tmp_path):
    edited = edit(good_run("search")[0], tmp_path / "edited", lambda run: None)
    text = (edited / RUN).read_text()
    (edited / RUN).write_text(re.sub(r'"seed": 1\b', '"seed": NaN', text))
    with pytest.raises(InvalidRun, match="must be strict JSON, got: the number NaN"):
        pk.load_front(edited)

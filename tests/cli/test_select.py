from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from tests.cli.commands import SMALL, load_front, strict


def test_select_as_json_gives_id_objectives_and_reason(paretoik, finished):
    front = load_front(finished)
    said = strict(paretoik("select", finished, "--weights", "kinetic_energy=1", "--json").out)
    assert said["id"] == front.ids[0]
    assert said["objectives"] == dict(zip(front.names, front.objectives[0].tolist(), strict=True))
    assert said["reason"].startswith(f"- Point {front.ids[0]} of {len(front)} has the least weighted sum")


def test_select_draws_a_picture_if_told(paretoik, finished, tmp_path):
    assert paretoik("select", finished, "--weights", "torque_norm=1", "--picture", tmp_path / "choice.png").code == 0
    assert (tmp_path / "choice.png").read_bytes().startswith(b"\x89PNG")


def test_every_preference_can_be_asked_for_and_is_kept_and_taken_back(paretoik, mine, tmp_path):
    run = tmp_path / "run"
    assert paretoik("solve", f"{mine}:good", "--out", run, *SMALL, "--quiet").code == 0
    asked = [
        ("--compromise",),
        ("--aspiration", "kinetic_energy=0.04"),
        ("--lexicographic", "torque_norm=20%,kinetic_energy"),
        ("--robust", "kinetic_energy=1,torque_norm=1", "--uncertainty", "0.5"),
        ("--bounds", "kinetic_energy<=1e3", "--weights", "torque_norm=1"),
        ("--classify", "kinetic_energy=free,torque_norm=improve"),
    ]
    for words in asked:
        assert paretoik("select", run, *words).code == 0
    history = strict(paretoik("select", run, "--history", "--json").out)
    assert [entry["parent"] for entry in history["entries"]] == [None, 1, 2, 3, 4, 5]
    assert strict(paretoik("select", run, "--undo", "--json").out)["current"] == 5


@pytest.fixture
def counted(tmp_path):
    """A run whose ids count from 0, as for an epsilon front or a merged one."""
    front = pk.Front(
        ids=np.arange(3),
        objectives=np.array([[0.0, 1.0], [0.4, 0.4], [1.0, 0.0]]),
        names=["energy", "torque"],
        units=["J", "N m"],
        maximised=[False, False],
    )
    front.save(tmp_path / "counted")
    return tmp_path / "counted"


def test_the_point_with_id_0_can_be_asked_for(paretoik, counted):
    assert strict(paretoik("select", counted, "--point", 0, "--json").out)["id"] == 0
    assert strict(paretoik("select", counted, "--point", 0, "--bounds", "energy<=0.5", "--json").out)["id"] == 0
    for other in ("--history", "--undo"):
        ended = paretoik("select", counted, other, "--point", 0)
        assert (ended.code, "got --point too" in ended.err) == (2, True)
    for words, got in ((("--point", 0, "--knee"), "got --knee and --point"), ((), "got none")):
        ended = paretoik("select", counted, *words)
        assert (ended.code, got in ended.err) == (2, True)


@pytest.mark.parametrize(("option", "owner"), [("uncertainty", "robust"), ("from", "classify")])
def test_an_option_of_another_preference_is_refused(paretoik, counted, option, owner):
    for words in (("--weights", "energy=1"), ("--bounds", "energy<=0.5"), ("--history",)):
        ended = paretoik("select", counted, *words, f"--{option}", 0)
        assert ended.code == 2
        assert len(ended.err.strip().splitlines()) == 1
    ended = paretoik("select", counted, "--knee", f"--{option}", 0)
    assert f"{option} must come with --{owner}, got no --{owner}" in ended.err

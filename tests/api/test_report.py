"""The verb ``report``: a run or a front becomes a page; everything else is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import paretoik as pk
from paretoik.api.solve import solve
from paretoik.errors import InvalidInput, InvalidRun
from paretoik.runs.files import REPORT, write_run
from problems import marcos_2012
from tests.api.problems import QUICK, tracking
from tests.closed_loop.postures import posture
from tests.review.page_reading import Page, unpacked


def read(file) -> Page:
    return Page(file.read_text(encoding="utf-8"))


def test_a_run_gets_its_report_into_its_folder(run):
    folder, front = run
    file = pk.report(folder)
    assert file == folder / REPORT
    page = read(file)
    assert page.data["ids"] == front.ids.tolist()
    assert len(page.data["blocks"]) == len(front)
    assert page.texts("h1") == ["The front of kinetic_energy and torque_norm"]
    assert any(text.startswith(f"{len(front)} points after") for text in page.texts("p"))
    assert {"fingerprint", "settings.seed", "versions.numpy", "status"} <= set(page.texts("th"))


def test_without_its_problem_a_run_shows_positions_and_says_how_to_see_more(run, problem):
    folder, _ = run
    page = read(pk.report(folder))
    (solved,) = page.texts("pre")
    assert f"{problem}".startswith(solved)  # the run describes its problem itself
    assert solved.startswith("Tracking")
    assert [each["name"] for each in page.data["motions"]["quantities"]] == ["position"]
    assert any("pk.report(folder, problem=problem)" in text for text in page.texts("p"))
    file = pk.report(pk.load_front(folder, problem))
    assert file == folder / REPORT
    page = read(file)
    assert len(page.data["motions"]["quantities"]) == 5
    assert page.data["motions"]["arm"]["planar"]


@pytest.mark.parametrize("verb", ["solve", "plan"])
def test_a_run_without_a_feasible_motion_says_why_and_shows_the_least_violating_one(verb, tmp_path):
    narrow = tracking(*([pk.kinetic_energy] if verb == "plan" else []), velocity=1.0)
    settings = {"starts": 6} if verb == "plan" else QUICK
    with pytest.raises(pk.Infeasible) as refused:
        getattr(pk, verb)(narrow, **settings, out=tmp_path / "run", observe=False)
    page = read(pk.report(tmp_path / "run", problem=narrow))
    assert page.texts("h1") == ["No feasible motion"]
    reason = str(refused.value)
    assert reason[0].upper() + reason[1:] in page.texts("p")
    assert any(text.startswith("In the least-violating motion, velocity of joint") for text in page.texts("p"))
    assert page.data["marks"] == {"0": "least-violating, not feasible"}
    assert "velocity" in page.data["motions"]["limits"]
    channels = unpacked(page.data["motions"], page.data["blocks"]["0"])
    np.testing.assert_allclose(channels[1:4], refused.value.motion.q.T, atol=1e-4)
    assert {"fingerprint", "settings.seed", "versions.numpy", "status"} <= set(page.texts("th"))


def test_a_run_without_a_front_says_which_command_shows_it(tmp_path):
    write_run(tmp_path, {"verb": "plan", "holds": "the optima of a plan, which load_plan opens"})
    with pytest.raises(InvalidRun, match=f"the optima of a plan.*paretoik show {tmp_path} shows it"):
        pk.report(tmp_path)


def test_a_closed_loop_shows_its_steps(tmp_path):
    loop = marcos_2012.loop(3, 0.7, start=posture(3), steps=6, population=12, generations=4)
    front = solve(loop, out=tmp_path / "loop")
    page = read(pk.report(tmp_path / "loop"))
    chosen = np.array(page.data["steps"]["chosen"])
    assert chosen.shape == (6, 2)
    np.testing.assert_allclose(chosen.mean(axis=0), front.objectives[0], rtol=1e-4)
    assert page.texts("h1") == ["A closed loop by joint_displacement and position_error"]
    for whole in (front, pk.load_front(tmp_path / "loop", loop)):
        assert read(pk.report(whole, tmp_path / "whole.html")).data["steps"] == page.data["steps"]


@pytest.mark.usefixtures("unchecked")
def test_what_cannot_be_written_or_read_is_refused_in_one_line(front, tmp_path):
    with pytest.raises(InvalidInput, match="file must be given for a front without a folder, got none"):
        pk.report(front)
    with pytest.raises(InvalidInput, match="report must be a file to write into, got the folder"):
        pk.report(front, tmp_path)
    with pytest.raises(InvalidInput, match="front must be a path"):
        pk.report(7)
    with pytest.raises(InvalidRun, match=r"must be a plain file, got no folder .*nowhere"):
        pk.report(tmp_path / "nowhere")


def test_damaged_steps_of_a_loop_are_refused(front, tmp_path):
    looped = {**front.provenance, "timeline": "step", "counts": {"steps": 1, "of": 1, "seconds": 0.0}}
    replace(front, problem=None, provenance=looped).save(tmp_path)
    (tmp_path / "steps.parquet").write_bytes(b"PAR1 no table")
    with pytest.raises(InvalidRun, match=r"steps\.parquet must contain the steps of a closed loop, got:"):
        pk.report(tmp_path)

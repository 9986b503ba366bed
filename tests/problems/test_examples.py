"""The worked examples run as they are, print what problems/README.md says, and become notebooks."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from pathlib import Path

import jupytext
import nbclient
import numpy as np
import pytest

import paretoik as pk

ROOT = Path(__file__).parents[2]
README = (ROOT / "problems" / "README.md").read_text(encoding="utf-8")
SCRIPTS = sorted((ROOT / "problems" / "examples").glob("*.py"))
slow = pytest.mark.slow


@pytest.fixture
def example(tmp_path, monkeypatch, capsys):
    """Return a function that runs an example in an empty folder: its names, and its output."""
    monkeypatch.chdir(tmp_path)

    def run(name):
        names = runpy.run_path(str(ROOT / "problems" / "examples" / f"{name}.py"), run_name="__main__")
        return names, capsys.readouterr().out

    return run


def largest(values) -> float:
    return float(np.abs(values).max())


def test_the_readme_lists_every_example_once_and_no_other():
    listed = re.findall(r"\]\(examples/(\w+)\.py\)", README)
    assert sorted(listed) == [script.stem for script in SCRIPTS]
    assert len(listed) == 12


def test_examples_contain_the_quotes_of_the_readme():
    for section in README.partition("\n## One's own\n")[0].split("\n### ")[1:]:
        (name,) = re.findall(r"\]\(examples/(\w+)\.py\)", section)
        (block,) = re.findall(r"```python\n(.*?)```", section, flags=re.DOTALL)
        lines = [line.strip() for line in block.splitlines() if line.strip()]
        script = (ROOT / "problems" / "examples" / f"{name}.py").read_text(encoding="utf-8")
        assert 1 <= len(lines) <= 5
        assert [line for line in lines if line not in script] == []


def test_every_example_is_short():
    lengths = {script.stem: len(script.read_text(encoding="utf-8").splitlines()) for script in SCRIPTS}
    assert {name: length for name, length in lengths.items() if not 20 <= length <= 90} == {}


def test_a_first_front_follows_the_path_within_limits_and_is_opened_again(example):
    names, printed = example("first_front")
    front = names["front"]
    assert front.motions.tracking_error.max() < 1e-9
    assert largest(front.motions.dq) <= 3.8 * (1 + 1e-9)
    assert np.array_equal(names["again"].objectives, front.objectives)
    assert Path("runs/first_front/front.png").is_file()
    assert f"{len(front)} points, equal: True" in printed


def test_ones_own_arm_carries_its_tool_and_a_broken_file_is_refused_fault_by_fault(example):
    names, printed = example("own_arm")
    arm, bare = names["arm"], names["bare"]
    assert sum(body.mass for body in arm.bodies) == pytest.approx(sum(body.mass for body in bare.bodies) + 0.95)
    assert largest(names["motion"].torque) > largest(names["unloaded"].torque)
    assert names["blocked"].dof == arm.dof - 1
    assert names["front"].motions.tracking_error.max() < 1e-9
    assert "mass must not be negative" in printed


def test_ones_own_objectives_are_integrals_and_peaks_of_the_motions_and_the_constraint_holds(example):
    names, printed = example("own_objectives")
    front = names["front"]
    motions = front.motions.instants
    effort = np.sum(motions.dq[..., 0] ** 2 * motions.weights, axis=-1)
    assert largest(front.objectives[:, 1] / effort - 1) < 1e-9
    assert largest(front.objectives[:, 2] - motions.links[..., 2, 1].min(axis=1)) < 1e-12
    assert largest(motions.torque[..., 2]) <= 0.05 * (1 + 1e-6)
    minima = front.certificates.status == "minimum"
    assert minima.mean() > 0.9  # at some points the wrist's torque exceeds its bound between samples
    assert all(reason.startswith("between samples: wrist_torque") for reason in front.certificates.reason[~minima])
    assert "must return shape" in printed


def test_obstacles_are_kept_clear_of_and_farther_costs_more(example):
    names, printed = example("obstacles")
    front = names["front"]
    energy, clearance = front.objectives.T
    assert clearance.min() >= 0.005 * (1 - 1e-6)
    assert largest(front.motions.instants.clearance.min(axis=1) - clearance) < 1e-9
    assert names["free"].objective < energy.min()
    assert (np.diff(clearance) > 0).all()
    assert "between link 3 and obstacle 1, a circle" in printed


def test_a_nozzle_that_may_turn_lets_joints_travel_less(example):
    names, printed = example("tasks_and_seams")
    posed, turned = (names["best"][axes].motion for axes in ("pose", "xyz+z-axis"))
    assert pk.joint_travel(turned) < pk.joint_travel(posed)
    assert largest(turned.tool_rotation[..., 2] - [0, 0, -1]) < 1e-9
    assert names["front"].motions.tracking_error.max() < 1e-9
    assert largest(names["trajectory"].dq) <= 2.61
    assert Path("runs/seam.csv").is_file()
    assert "it must start at rest" in printed
    assert largest(names["closed"].motion.q[-1] - names["closed"].motion.q[0]) == 0


def test_a_refined_front_is_certified_and_no_worse_than_what_was_searched(example):
    names, _ = example("refining")
    rough, front = names["rough"], names["front"]
    for point, better in zip(front.ids, front.objectives, strict=True):
        assert (better <= rough.objectives[rough.ids == point][0] * (1 + 1e-9)).all()
    for certified in (front, names["swept"]):
        assert set(certified.certificates.status) == {"minimum"}
        assert certified.certificates.criticality.max() < 1e-6
    assert "swept" in repr(names["comparison"])
    rates = front.certificates.exchange_rates[:, 0, 1]
    assert (rates[np.isfinite(rates)] < 0).all()


def test_every_preference_keeps_to_its_word_and_the_run_keeps_the_choices(example):
    names, printed = example("choosing")
    front = names["front"]
    energy, torque = front.objectives.T
    within = energy <= 0.041
    assert names["cheap"].objectives[1] == torque[within].min()
    near_best = torque <= torque.min() + 0.1 * np.ptp(front.ranges[1])
    assert names["first"].objectives[0] == energy[near_best].min()
    assert names["better"].objectives[0] < names["robust"].objectives[0]
    assert names["better"].objectives[1] <= 0.075
    assert len(front.choices) == 8  # seven, and the reader's own after an undo
    assert front.choices.chosen.point == names["own"].id
    assert Path("runs/choosing/report.html").stat().st_size < 5e6
    assert f"point {names['cheap'].id}" in printed


def test_each_move_along_a_front_gives_what_was_asked_for_and_a_certificate(example):
    names, printed = example("navigating")
    front, moved, now = names["front"], names["moved"], names["now"]
    assert now.objectives[0] == pytest.approx(0.040, rel=1e-6)
    for later in (moved, names["dense"]):
        for gone in front.objectives[~np.isin(front.ids, later.ids)]:  # only points that a new one dominates
            assert (later.objectives <= gone).all(axis=1).any()
    assert now.id not in front.ids
    assert set(moved.certificates.status) == {"minimum"}
    assert moved.certificates.criticality.max() < 1e-6
    assert 1 <= len(names["new"]) <= 4
    assert "refused: navigate" in printed


@slow
def test_a_closed_loop_that_weighs_the_error_more_follows_more_exactly(example):
    names, _ = example("closed_loop")
    followed = names["choice"].motion
    assert followed.position_error[1:].mean() < names["run"].position_error
    assert Path("runs/closed_loop/review.rrd").stat().st_size > 0
    assert len(names["front"]) == 1


def test_resolvers_keep_what_they_promise_and_the_whole_motion_is_better(example):
    names, printed = example("resolvers")
    motion = names["motion"]
    assert names["rates"].max() <= 1.6 * (1 + 1e-6)
    assert motion.tracking_error.max() < 1e-9
    assert names["front"].objectives[:, 0].min() < names["energy"]  # Nedungadi's, exact from its start on
    assert names["best"].motion.clearance.min() >= 0.01 * (1 - 1e-6)
    assert "clearance between link 2 and obstacle 1" in printed


def test_sliders_are_faster_along_most_directions_and_point_to_point_arrives(example):
    names, _ = example("directions")
    assert names["faster"].sum() == 12  # of 16, as in Kim et al. 2021 with our assumptions
    refined = names["refined"]
    assert largest(refined.motions.tool[:, -1] - names["place"]) < 1e-9
    assert np.allclose(refined.objectives[:, 0], refined.motions.time[:, -1])
    assert set(refined.certificates.status) <= {"minimum", "undetermined"}


def test_pymoo_and_paretoik_solve_each_others_problems(example):
    names, _ = example("pymoo_day")
    assert names["motions"].tracking_error.max() < 1e-9
    assert names["search"].generation == 60
    assert names["search"].evaluations == 60 * 60
    assert set(names["best"]) >= {"feedback", "damping"}


@slow
def test_the_command_of_the_readme_makes_notebooks_and_one_runs(tmp_path):
    (line,) = re.findall(r"^jupytext .*$", README, flags=re.MULTILINE)
    folder = tmp_path / "problems" / "examples"
    folder.mkdir(parents=True)
    for script in SCRIPTS:
        (folder / script.name).write_text(script.read_text(encoding="utf-8"), encoding="utf-8")
    subprocess.run(f"{sys.executable} -m {line}", shell=True, check=True, cwd=tmp_path, capture_output=True)
    assert sorted(file.stem for file in folder.glob("*.ipynb")) == [script.stem for script in SCRIPTS]
    notebook = jupytext.read(folder / "first_front.ipynb")
    nbclient.NotebookClient(notebook, kernel_name="python3", resources={"metadata": {"path": folder}}).execute()
    outputs = [output.get("text", "") for cell in notebook.cells for output in cell.get("outputs", ())]
    assert "Front of" in "".join(outputs)
    assert notebook.cells[0].cell_type == "markdown"

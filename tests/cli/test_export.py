"""The command ``export`` on real runs: what it writes, refuses and advises."""

from __future__ import annotations

import csv
import re
import shutil

import numpy as np
import pytest

from tests.cli.commands import PANDA, load_front, strict

ACROSS = f"""
from paretoik import Arm, Tracking, kinetic_energy, line, torque_norm

def across() -> Tracking:
    arm = Arm.from_urdf({PANDA!r}, base="panda_link0", tip="panda_hand_tcp")
    path = line([0.45, -0.2, 0.3], [0.45, 0.2, 0.3], duration=0.5, samples=21)
    return Tracking(arm, path, objectives=[kinetic_energy, torque_norm], coefficients=4, bases=2)
"""


@pytest.fixture(scope="module")
def panda_run(tmp_path_factory):
    """A run of a real arm with a short duration."""
    from paretoik.api.solve import solve
    from paretoik.loading import load_problem

    place, run = tmp_path_factory.mktemp("panda"), tmp_path_factory.mktemp("runs") / "panda"
    (place / "hasty_panda.py").write_text(ACROSS)
    reference = f"{place / 'hasty_panda.py'}:across"
    front = solve(load_problem(reference), population=8, generations=2, seed=1, reference=reference, observe=False)
    front.save(run)
    return run, int(front.ids[0])


def rows(file):
    lines = [line for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    names, *values = csv.reader(lines)
    return names, np.array(values, dtype=float)


def test_a_point_is_written_into_its_run_by_default(paretoik, finished, tmp_path):
    run = shutil.copytree(finished, tmp_path / "run")
    front = load_front(run)
    ended = paretoik("export", run, "--point", front.ids[1], "--rate", "50")
    assert ended.code == 0
    place = run / f"point-{front.ids[1]}.csv"
    assert ended.out == (
        f"{place}: point {front.ids[1]}, 51 samples of 3 joints at 50 Hz, 1 s\n"
        "not checked against a controller's limits: --controller NAME does it\n"
    )
    names, values = rows(place)
    assert names[:2] == ["time", "position.joint1"]
    np.testing.assert_allclose(values[:, 1:4], front.motions[1].at(values[:, 0]), atol=1e-12)
    assert load_front(run).ids.tolist() == front.ids.tolist()  # the run is as it was


def test_the_present_choice_is_written_if_no_point_is_named(paretoik, finished, tmp_path):
    run = shutil.copytree(finished, tmp_path / "run")
    chosen = load_front(run).select("compromise")
    ended = paretoik("export", run, "--rate", "50")
    assert ended.code == 0
    assert ended.out.startswith(f"{run / f'point-{chosen.id}.csv'}: point {chosen.id} (the present choice), ")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "error: --point: the id of a point must be given unless a choice is kept (paretoik select RUN"),
        (("--point", "99999"), "error: --point: ids must be those of the front's points ("),
        (("--point", "FIRST", "--joints", "a,b"), "got the unknown 'a'"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(paretoik, finished, tmp_path, words, said):
    run = shutil.copytree(finished, tmp_path / "run", ignore=shutil.ignore_patterns("choices.json"))
    first = str(load_front(run).ids[0])
    ended = paretoik("export", run, *(first if word == "FIRST" else word for word in words))
    assert ended.code == 2
    assert said in ended.err
    assert len(ended.err.strip().splitlines()) == 1


@pytest.mark.parametrize(("format", "place"), [("ros2-bag", "a_bag"), ("csv", "a.txt")])
def test_a_format_can_be_asked_for_and_nothing_is_overwritten_unasked(paretoik, finished, tmp_path, format, place):
    point = load_front(finished).ids[0]
    words = "export", finished, "--point", point, "--rate", "20", "--format", format, "--out", tmp_path / place
    ended = paretoik(*words, "--json")
    assert strict(ended.out)["out"] == str(tmp_path / place)
    assert strict(ended.out)["samples"] == 21
    assert strict(ended.out)["objectives"].keys() == {"kinetic_energy", "torque_norm"}
    assert paretoik(*words).code == 2
    assert paretoik(*words, "--overwrite").code == 0


def test_a_hasty_motion_is_refused_and_the_advice_leads_to_one_that_a_franka_takes(paretoik, panda_run, tmp_path):
    run, point = panda_run
    words = "export", run, "--point", point, "--controller", "franka", "--out", tmp_path / "franka.csv"
    ended = paretoik(*words)
    assert ended.code == 3
    assert re.search(
        r"error: controller panda: it must (start|end) at rest, but panda_joint\d (start|end)s with", ended.err
    )
    (ramp,) = re.findall(r"--ramp ([\d.]+)", ended.err)
    slow = ["--slow-down"] if "--slow-down" in ended.err else []
    assert not (tmp_path / "franka.csv").exists()
    ended = paretoik(*words, "--ramp", ramp, *slow)
    assert ended.code == 0
    assert "within the limits of panda; the motion uses: " in ended.out
    _, values = rows(tmp_path / "franka.csv")
    np.testing.assert_allclose(np.diff(values[:, 0]), 1e-3, atol=1e-9)
    acceleration = np.diff(values[:, 1:8], n=2, axis=0) / 1e-6
    assert (np.abs(acceleration) <= [15, 7.5, 10, 12.5, 15, 20, 20]).all()


def test_ones_own_controller_is_named_by_its_file(paretoik, finished, tmp_path):
    (tmp_path / "own_bench.py").write_text(
        "from paretoik.joint_trajectory.controllers import Controller\n"
        'BENCH = Controller(name="bench", joint_names=["joint1", "joint2", "joint3"], rate=250, velocity=0.3)\n'
    )
    run = shutil.copytree(finished, tmp_path / "run")
    words = "export", run, "--point", str(load_front(run).ids[0]), "--controller"
    ended = paretoik(*words, f"{tmp_path / 'own_bench.py'}:BENCH")
    assert ended.code == 3  # it does not keep the limits
    assert "controller bench" in ended.err
    ended = paretoik(*words, f"{tmp_path / 'own_bench.py'}:BENHC")
    assert "got 'BENHC'; did you mean 'BENCH'" in ended.err

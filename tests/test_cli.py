"""The command line as a user meets it: what stands on stdout, what on stderr, and the exit code."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
import rerun as rr

from paretoik import __version__
from paretoik.api.solve import load_front
from paretoik.cli import main
from paretoik.errors import InvalidInput
from paretoik.execution.run_folder import claim_folder

ROOT = Path(__file__).parents[1]
TRINGALI = str(ROOT / "problems" / "tringali_2020.py")
PANDA = str(ROOT / "problems" / "robots" / "panda.urdf")
SMALL = ("--population", "8", "--generations", "3")
MINE = """
from paretoik import Limits, Tracking, kinetic_energy, line, objective, torque_norm
from paretoik.robot.arms import tringali_3r

PATH = line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=21)

@objective(unit="", form="general")
def worn(motion):
    raise RuntimeError("the bearing\\nis worn")

@objective(unit="", form="general")
def chatty(motion):
    print("chatter")
    return motion.q[..., 0, 0]

def tracking(*objectives, **limits):
    return Tracking(
        tringali_3r(), PATH, objectives=objectives, limits=Limits(**limits), coefficients=4, bases=2
    )

def good() -> Tracking:
    '''[bold]Good[/bold] for tests.'''
    return tracking(kinetic_energy, torque_norm)

def impossible() -> Tracking:
    return tracking(kinetic_energy, torque_norm, velocity=1e-3)

def failing() -> Tracking:
    return tracking(kinetic_energy, worn)

def talking() -> Tracking:
    print("hello")
    return tracking(kinetic_energy, chatty)
"""


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    code: int
    out: str
    err: str


@pytest.fixture
def paretoik(capsys, monkeypatch):
    """Run the command line within this process."""

    def run(*words: str | Path) -> Ended:
        monkeypatch.setattr(sys, "argv", ["paretoik", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        said = capsys.readouterr()
        return Ended(int(ended.value.code or 0), said.out, said.err)

    return run


@pytest.fixture(scope="module")
def mine(tmp_path_factory):
    file = tmp_path_factory.mktemp("users") / "users_own_problems.py"
    file.write_text(MINE)
    return str(file)


@pytest.fixture(scope="module")
def finished(tmp_path_factory, mine):
    """A finished run, to be read only."""
    out = tmp_path_factory.mktemp("runs") / "finished"
    command = [sys.executable, "-m", "paretoik", "solve", f"{mine}:good", "--out", str(out), *SMALL, "--quiet"]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return out


def strict(text: str) -> object:
    return json.loads(text, parse_constant=pytest.fail)


def test_version_is_printed(paretoik):
    assert paretoik("--version") == Ended(0, f"paretoik {__version__}\n", "")


def test_help_names_every_command_and_the_exit_codes(paretoik):
    said = paretoik("--help").out
    for word in ("list", "solve", "select", "show", "check-robot", "--version", "3 infeasible"):
        assert word in said


def test_a_misspelt_command_is_met_with_the_right_one(paretoik):
    ended = paretoik("slove")
    assert ended.code == 2
    assert ended.out == ""
    assert "'solve'" in ended.err


def test_list_shows_each_problem_with_what_it_is(paretoik, monkeypatch):
    monkeypatch.chdir(ROOT)
    ended = paretoik("list")
    names = [line.split()[0] for line in ended.out.splitlines()]
    assert ended.code == 0
    assert {"problems/tringali_2020.py:energy_torque", "problems/panda.py:across_the_table"} <= set(names)
    assert all(len(line.split()) > 3 for line in ended.out.splitlines())


def test_list_prints_documentation_as_it_is_written(paretoik, mine):
    assert f"{mine}:good        [bold]Good[/bold] for tests." in paretoik("list", mine).out


def test_a_file_that_cannot_be_listed_does_not_hide_the_others(paretoik, mine, tmp_path):
    (tmp_path / "torn.py").write_text("def f(:")
    ended = paretoik("list", tmp_path / "torn.py", mine, "--json")
    assert ended.code == 2
    assert ended.err.startswith("error: problem file ")
    assert ended.err.count("\n") == 1
    assert {"problem": f"{mine}:good", "about": "[bold]Good[/bold] for tests."} in strict(ended.out)


def test_list_without_any_file_says_where_it_looked(paretoik, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert paretoik("list") == Ended(
        2, "", f"error: list: wanted a file, got none, and there is no problems/*.py in {tmp_path}\n"
    )


def test_solve_keeps_a_run_that_select_reads(paretoik, mine, tmp_path):
    out = tmp_path / "run"
    ended = paretoik("solve", f"{mine}:good", "--out", out, *SMALL, "--seed", "1")
    assert ended.code == 0
    assert "generation" not in ended.out.splitlines()[1]
    assert f"paretoik select {out} --weights kinetic_energy=0.5,torque_norm=0.5" in ended.out
    assert ended.err.startswith("generation 1/3, front ")
    assert {"run.json", "front.parquet", "motions.npz", "review.rrd", "front.png"} <= {f.name for f in out.iterdir()}
    chosen = paretoik("select", out, "--weights", "kinetic_energy=0.3,torque_norm=0.7")
    assert chosen.code == 0
    assert "has the least weighted sum (kinetic_energy 30%, torque_norm 70%)" in chosen.out


def test_json_on_stdout_is_strict_and_holds_the_front_of_the_folder_and_quiet_says_no_more(paretoik, mine, tmp_path):
    ended = paretoik("solve", f"{mine}:good", "--out", tmp_path / "run", *SMALL, "--json", "--quiet")
    said, front = strict(ended.out), load_front(tmp_path / "run")
    assert (ended.code, ended.err) == (0, "")
    assert [entry["id"] for entry in said["front"]] == front.ids.tolist()
    assert [list(entry["objectives"].values()) for entry in said["front"]] == front.objectives.tolist()
    assert (said["status"], said["counts"]["generations"]) == ("generations", 3)


def test_what_a_users_functions_print_does_not_mix_with_the_result(paretoik, mine, tmp_path):
    ended = paretoik("solve", f"{mine}:talking", "--out", tmp_path / "run", *SMALL, "--quiet", "--json")
    assert strict(ended.out)["status"] == "generations"
    assert ended.err.startswith("hello\nchatter\n")


def test_select_as_json_gives_id_objectives_and_reason(paretoik, finished):
    front = load_front(finished)
    said = strict(paretoik("select", finished, "--weights", "kinetic_energy=1", "--json").out)
    assert said["id"] == front.ids[0]
    assert said["objectives"] == dict(zip(front.names, front.objectives[0].tolist(), strict=True))
    assert said["reason"].startswith(f"Of {len(front)} points point {front.ids[0]} has the least weighted sum")


def test_select_draws_a_picture_where_told(paretoik, finished, tmp_path):
    assert paretoik("select", finished, "--weights", "torque_norm=1", "--picture", tmp_path / "choice.png").code == 0
    assert (tmp_path / "choice.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["solve", "missing.py:p", "--out", "OUT"], "problem file missing.py: wanted a file, got nothing of that name"),
        (["solve", "MINE:goood", "--out", "OUT"], "got 'goood'; did you mean 'good'?"),
        (
            ["solve", "MINE:good", "--out", "OUT", "--population", "3"],
            "population: an integer of at least 4 wanted, got 3",
        ),
        (["solve", "MINE:good", "--out", "OUT", "--generations", "0"], "generations: an integer of at least 1 wanted"),
        (["solve", "MINE:good", "--out", "OUT", "--seed", "-1"], "seed: an integer of at least 0 wanted, got -1"),
        (
            ["solve", "MINE:good", "--out", "OUT", "--time-limit", "nan"],
            "time limit: more than 0 seconds wanted, got nan",
        ),
        (["solve", "MINE:good", "--out", "MINE"], "wanted a folder to write a run into, got File exists"),
        (["select", "OUT", "--weights", "kinetic_energy=1"], "run.json: wanted a plain file, got nothing"),
        (
            ["select", "RUN", "--weights", "kinetic_energy"],
            "weights: wanted NAME=NUMBER,NAME=NUMBER, got 'kinetic_energy'",
        ),
        (["select", "RUN", "--weights", "torque_norm=much"], "weights: wanted a number for torque_norm, got 'much'"),
        (
            ["select", "RUN", "--weights", "torque_norm=1,torque_norm=2"],
            "wanted each objective once, got torque_norm twice",
        ),
        (["select", "RUN", "--weights", "torque=1"], "wanted names among kinetic_energy, torque_norm, got 'torque'"),
        (["select", "RUN", "--weights", "torque_norm=0"], "weights: wanted at least one above zero"),
        (["select", "RUN", "--weights", "torque_norm=nan"], "wanted a finite number >= 0 for torque_norm, got nan"),
        (["show", "OUT"], "review.rrd: wanted a recording, got nothing"),
        (["check-robot", "missing.urdf"], "missing.urdf"),
        (["check-robot", "PANDA", "--tip", "thumb"], "tip 'thumb' is not a link"),
    ],
)
def test_bad_input_is_one_line_on_stderr_and_exit_code_2(paretoik, mine, finished, tmp_path, words, message):
    names = {"MINE": mine, "OUT": str(tmp_path / "out"), "RUN": str(finished), "PANDA": PANDA}
    ended = paretoik(*(names.get(word, word.replace("MINE:", f"{mine}:")) for word in words))
    assert (ended.code, ended.out) == (2, "")
    error = ended.err.splitlines()[-1]
    assert error.startswith("error: ")
    assert message in error
    assert [line for line in ended.err.splitlines()[:-1] if not line.startswith("generation")] == []


def test_a_run_is_not_replaced_unless_told(paretoik, mine, finished):
    before = {file.name: file.read_bytes() for file in finished.iterdir()}
    refused = paretoik("solve", f"{mine}:good", "--out", finished, *SMALL, "--quiet")
    assert refused.code == 2
    assert "--overwrite" in refused.err
    before.pop(".lock")
    assert {file.name: file.read_bytes() for file in finished.iterdir() if file.name in before} == before


def test_an_infeasible_problem_names_the_limit_and_ends_with_3(paretoik, mine, tmp_path):
    ended = paretoik("solve", f"{mine}:impossible", "--out", tmp_path / "run", *SMALL, "--quiet")
    assert (ended.code, ended.out) == (3, "")
    assert "velocity" in ended.err
    assert json.loads((tmp_path / "run" / "run.json").read_text())["status"] == "Infeasible"


def test_a_problem_of_which_every_evaluation_fails_names_the_cause_and_ends_with_4(paretoik, mine, tmp_path):
    ended = paretoik("solve", f"{mine}:failing", "--out", tmp_path / "run", *SMALL, "--quiet")
    assert (ended.code, ended.out) == (4, "")
    assert "RuntimeError: the bearing is worn" in ended.err
    assert ended.err.count("\n") == 1


def test_a_time_limit_keeps_the_result_and_ends_with_5(paretoik, mine, tmp_path):
    ended = paretoik("solve", f"{mine}:good", "--out", tmp_path / "run", "--time-limit", "0.01")
    assert ended.code == 5
    assert "(ended by time limit)" in ended.out
    assert len(load_front(tmp_path / "run"))


def test_check_robot_lists_the_chain_and_ends_with_0_or_every_fault_and_2(paretoik, tmp_path):
    sound = paretoik("check-robot", PANDA, "--tip", "panda_hand")
    assert sound.code == 0
    assert sound.out.endswith("no faults\n")
    assert "panda_joint7: revolute" in sound.out
    (tmp_path / "lame.urdf").write_text("<robot name='lame'><link name='a'/><link name='b'/></robot>")
    lame = paretoik("check-robot", tmp_path / "lame.urdf")
    assert lame.code == 2
    assert "fault: " in lame.out
    said = strict(paretoik("check-robot", tmp_path / "lame.urdf", "--json").out)
    assert [f"fault: {fault}" for fault in said["faults"]] == [
        line for line in lame.out.splitlines() if line.startswith("fault")
    ]


def started(mine: str, out: Path) -> subprocess.Popen[str]:
    """Return a run in a process of its own that has finished its first generation and would go on for long."""
    command = [sys.executable, "-m", "paretoik", "solve", f"{mine}:good", "--out", str(out)]
    command += ["--population", "40", "--generations", "100000"]
    process = subprocess.Popen(
        command,
        cwd=ROOT,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    assert process.stderr.readline().startswith("generation 1/100000, front ")
    return process


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_run_keeps_its_result(paretoik, mine, tmp_path, number, code):
    process = started(mine, tmp_path / "run")
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == code
    assert f"(ended by {number.name})" in out
    assert "Traceback" not in err
    assert len(load_front(tmp_path / "run"))
    assert paretoik("select", tmp_path / "run", "--weights", "torque_norm=1").code == 0


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_a_killed_run_leaves_a_readable_recording_and_no_lock(paretoik, mine, tmp_path):
    process = started(mine, tmp_path / "run")
    with pytest.raises(InvalidInput, match=f"got process {process.pid} at work"), claim_folder(tmp_path / "run"):
        pass
    time.sleep(0.5)  # for more generations to be under way
    process.kill()
    process.communicate()
    reader = rr.chunk.RrdReader(tmp_path / "run" / "review.rrd")
    (store,) = reader.recordings()
    assert "/search/front" in {str(chunk.entity_path) for chunk in reader.stream(store=store)}
    selected = paretoik("select", tmp_path / "run", "--weights", "torque_norm=1")
    assert selected.code == 2
    assert "got one of status 'running' without" in selected.err
    again = paretoik(
        "solve", f"{mine}:good", "--out", tmp_path / "run", *SMALL, "--quiet", "--overwrite", "--seed", "5"
    )
    assert again.code == 0
    assert load_front(tmp_path / "run").provenance["settings"]["seed"] == 5


def test_a_warning_is_one_line_on_stderr(mine, finished, tmp_path):
    moved = tmp_path / "moved"
    moved.mkdir()
    for file in finished.iterdir():
        (moved / file.name).write_bytes(file.read_bytes())
    elsewhere = Path(mine).rename(Path(mine).with_suffix(".gone"))
    try:
        command = [sys.executable, "-m", "paretoik", "select", str(moved), "--weights", "torque_norm=1"]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    finally:
        elsewhere.rename(mine)
    assert ended.stderr.startswith("warning: ")
    assert "motions come without their arm" in ended.stderr
    assert ended.stderr.count("\n") == 1

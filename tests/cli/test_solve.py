from __future__ import annotations

import json
import re
import shlex
import signal
import time

import pytest
import rerun as rr

from paretoik.errors import InvalidInput
from paretoik.runs.folder import claim_folder
from tests.cli.commands import SMALL, first_progress, load_front, started, strict
from tests.review.children import children, wait_for_end


def test_solve_keeps_a_run_that_select_reads(paretoik, mine, tmp_path):
    out = tmp_path / "run"
    ended = paretoik("solve", f"{mine}:good", "--out", out, *SMALL, "--seed", "1")
    assert ended.code == 0
    assert "generation" not in ended.out.splitlines()[1]
    assert f"paretoik select {out} --weights kinetic_energy=0.5,torque_norm=0.5" in ended.out
    assert first_progress(ended.err.splitlines()).startswith("generation 1/3, front ")
    assert {"run.json", "front.parquet", "motions.npz", "review.rrd", "front.png"} <= {f.name for f in out.iterdir()}
    chosen = paretoik("select", out, "--weights", "kinetic_energy=0.3,torque_norm=0.7")
    assert chosen.code == 0
    words = " ".join(chosen.out.split())
    assert "has the least weighted sum" in words
    assert "(kinetic_energy 30%, torque_norm 70%)" in words


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


def test_a_run_is_not_replaced_unless_told(paretoik, mine, finished):
    before = {file.name: file.read_bytes() for file in finished.iterdir() if file.is_file()}
    refused = paretoik("solve", f"{mine}:good", "--out", finished, *SMALL, "--quiet")
    assert refused.code == 2
    assert "--overwrite" in refused.err
    before.pop(".lock")
    assert {name: (finished / name).read_bytes() for name in before} == before


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
    assert "(the time limit was reached)" in ended.out
    assert len(load_front(tmp_path / "run"))
    (command,) = re.findall(r"^resume:  (paretoik resume .*)$", ended.out, flags=re.MULTILINE)
    again = paretoik(*shlex.split(command)[1:], "--time-limit", "0.01", "--json")
    assert again.code == 5
    assert strict(again.out)["resume"] == command


@pytest.mark.parametrize("option", ["--time-limit", "--evaluation-timeout"])
def test_an_objective_that_sleeps_is_ended_by_name_within_its_time(paretoik, mine, tmp_path, option):
    began = time.monotonic()
    ended = paretoik("solve", f"{mine}:sleeping", "--out", tmp_path / "run", *SMALL, "--quiet", option, "0.2")
    assert time.monotonic() - began < 30
    assert (ended.code, ended.out) == (4, "")
    assert "objective asleep took longer than" in ended.err
    assert ended.err.count("\n") == 1


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_run_keeps_its_result(paretoik, mine, tmp_path, number, code):
    process = started(mine, tmp_path / "run")
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == code
    assert f"(ended by {number.name})" in out
    assert f"\nresume:  paretoik resume {tmp_path / 'run'} --problem {mine}:good\n" in out
    assert "Traceback" not in err
    assert len(load_front(tmp_path / "run"))
    assert paretoik("select", tmp_path / "run", "--weights", "torque_norm=1").code == 0


def test_a_killed_run_leaves_a_complete_recording_and_no_lock(paretoik, mine, tmp_path):
    process = started(mine, tmp_path / "run")
    with pytest.raises(InvalidInput, match=f"got process {process.pid} at work"), claim_folder(tmp_path / "run"):
        pass
    time.sleep(0.5)  # for more generations to be under way
    (recorder,) = children(process.pid)
    process.kill()
    process.communicate()
    wait_for_end(recorder)
    reader = rr.chunk.RrdReader(tmp_path / "run" / "review.rrd")
    (store,) = reader.recordings()
    assert "/search/front" in {str(chunk.entity_path) for chunk in reader.stream(store=store)}
    selected = paretoik("select", tmp_path / "run", "--weights", "torque_norm=1")
    assert selected.code == 2
    assert "got one of status 'running' without" in selected.err
    with claim_folder(tmp_path / "run", overwrite=True):
        pass

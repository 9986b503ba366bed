"""Closed loops on the command line: listed, followed, chosen from again, ended early."""

from __future__ import annotations

import json
import signal

import pytest

import paretoik as pk
from tests.cli.commands import first_progress, start_process
from tests.closed_loop.postures import posture

MINE = """
import numpy as np
import paretoik as pk

START = np.array({start})

def short() -> pk.ClosedLoop:
    '''A few steps for tests.'''
    return loop(12)

def long() -> pk.ClosedLoop:
    return loop(4000)

def loop(steps):
    path = pk.circle((0.7, 0.0), 0.5, duration=1e-3 * steps, samples=steps + 1, turns=1.1e-3 * steps, timing="uniform")
    return pk.ClosedLoop(pk.arms.marcos_nr(3), path, start=START, population=20, generations=10)
"""


@pytest.fixture(scope="session")
def loops(tmp_path_factory):
    file = tmp_path_factory.mktemp("loops") / "users_own_loops.py"
    file.write_text(MINE.format(start=posture(3).tolist()))
    return str(file)


def test_loops_are_listed_followed_and_chosen_from_again(paretoik, loops, tmp_path):
    listing = paretoik("list", loops).out
    assert f"{loops}:short" in listing
    assert "A few steps for tests." in listing
    ended = paretoik("solve", f"{loops}:short", "--out", tmp_path / "run", "--seed", 2)
    assert "12 of 12 steps" in ended.out
    assert first_progress(ended.err.splitlines()).startswith("step 1/12, front ")
    weighed = "--weights", "position_error=1", "--out", tmp_path / "other", "--quiet", "--json"
    chosen = paretoik("select", tmp_path / "run", *weighed)
    assert chosen.err == ""
    other = pk.Front.load(tmp_path / "other")
    assert json.loads(chosen.out)["objectives"]["position_error"] == other.objectives[0, 1]
    assert other.provenance["settings"]["weights"] == {"joint_displacement": 0.0, "position_error": 1.0}
    assert other.provenance["settings"]["seed"] == 2
    refused = paretoik("select", tmp_path / "run", "--weights", "speed=1").err
    assert refused.startswith("error: weights must have names among joint_displacement, position_error, got 'speed'")


def test_an_interrupted_loop_keeps_its_steps(loops, tmp_path):
    process = start_process("solve", f"{loops}:long", "--out", tmp_path / "run")
    assert first_progress(process.stderr).startswith("step 1/4000, front ")
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "of 4000 steps" in out
    assert "Traceback" not in err
    assert pk.Front.load(tmp_path / "run").motions.q.shape[1] >= 3

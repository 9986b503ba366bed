"""The commands plan, front and refine."""

from __future__ import annotations

import os
import re
import shlex
import signal
from importlib import import_module

import numpy as np
import pytest

import paretoik as pk
from tests.api.test_interruption import interrupt_restarts
from tests.cli.commands import strict


def test_front_and_refine_keep_runs_and_print_strict_json(paretoik, mine, tmp_path):
    found = paretoik("front", f"{mine}:good", "--out", tmp_path / "f", "--points", "3", "--starts", "4", "--quiet")
    assert (found.code, found.err) == (0, "")
    assert "levels of ε" in found.out.splitlines()[0]
    refined = paretoik("refine", tmp_path / "f", "--out", tmp_path / "r", "--quiet", "--json")
    assert refined.code == 0
    assert strict(refined.out)["parent"]["run"] == str(tmp_path / "f")


def test_plan_lists_the_optima(paretoik, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "one_objective.py"
    file.write_text(ONE)
    ended = paretoik("plan", f"{file}:one", "--out", tmp_path / "p", "--starts", "4", "--quiet", "--json")
    assert ended.code == 0
    assert (tmp_path / "p" / "review.rrd").stat().st_size > 100_000
    optima = strict(ended.out)["optima"]
    assert [each["objective"] for each in optima] == sorted(each["objective"] for each in optima)
    assert export_reads(paretoik, tmp_path / "p", optima)
    refused = paretoik("refine", tmp_path / "p", "--out", tmp_path / "r", "--quiet")
    assert refused.code == 2
    assert "holds the optima of a plan" in refused.err


def export_reads(paretoik, run, optima) -> bool:
    """Export the best and the last optimum of a plan; return whether the files have their motions."""
    last = optima[-1]
    best = strict(paretoik("export", run, "--rate", "20", "--json").out)
    assert (best["point"], best["out"], best["samples"]) == (0, str(run / "point-0.csv"), 21)
    assert paretoik("export", run, "--point", len(optima)).code == 2
    ended = paretoik("export", run, "--point", last["id"], "--out", run / "last.npz", "--json")
    assert strict(ended.out)["objectives"] == {"kinetic_energy": f"{last['objective']:.6g} J s"}
    with np.load(run / "last.npz") as stored, np.load(run / "motions.npz") as motions:
        return bool(np.abs(stored["q"][[0, -1]] - motions["q"][-1][[0, -1]]).max() < 1e-9)


def test_an_interrupted_plan_names_the_starts_that_it_had_and_no_picture_that_it_has_not(
    paretoik, tmp_path, monkeypatch
):
    file, out = tmp_path / "interrupted_plan.py", tmp_path / "p"
    file.write_text(ONE)
    interrupt_restarts(monkeypatch)
    ended = paretoik("plan", f"{file}:one", "--out", out, "--quiet")
    assert ended.code == 130
    first = re.match(r"\d+ distinct optim(a|um) from (\d+) starts in .* s \(stopped by SIGINT\)\n", ended.out)
    assert first is not None
    assert int(first[2]) >= 12
    assert "pictured" not in ended.out


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_before_any_result_has_its_own_line_and_exit_code(paretoik, tmp_path, monkeypatch, number):
    module = import_module("paretoik.formulations.tracking")
    file, out = tmp_path / f"plan_ended_by_{number.name}.py", tmp_path / "it's here"
    file.write_text(ONE)
    find_optima = module.find_optima

    def interrupted(*arguments, **settings):
        os.kill(os.getpid(), number)
        return find_optima(*arguments, **settings)

    monkeypatch.setattr(module, "find_optima", interrupted)
    ended = paretoik("plan", f"{file}:one", "--out", out, "--quiet", "--json")
    assert (ended.code, ended.out) == (6, "")
    first, second = ended.err.splitlines()
    assert first == "error: interrupted before there was a whole result"
    monkeypatch.setattr(module, "find_optima", find_optima)
    command = re.fullmatch(r"note: (paretoik resume .*) resumes it", second)
    assert command is not None
    assert paretoik(*shlex.split(command[1])[1:], "--quiet").code == 0
    assert len(pk.load_plan(out, f"{file}:one").optima)


def test_wrong_combinations_are_one_line_and_2(paretoik, mine, finished, tmp_path):
    for words, said in (
        (("plan", f"{mine}:good", "--out", tmp_path / "p"), "plan: problem must have one objective, got 2"),
        (("refine", finished, "--out", finished), "out must not be the folder of the source run"),
        (("front", f"{mine}:good", "--out", finished), "use --overwrite"),
        (("refine", tmp_path, "--out", tmp_path / "r"), "must be a plain file, got no such file"),
    ):
        ended = paretoik(*words, "--quiet")
        assert (ended.code, ended.out, ended.err.count("\n")) == (2, "", 1)
        assert said in ended.err


ONE = """
from paretoik import Tracking, kinetic_energy, line
from paretoik.robot.arms import tringali_3r

def one() -> Tracking:
    path = line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=21)
    return Tracking(tringali_3r(), path, objectives=[kinetic_energy], coefficients=4, bases=2)
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import paretoik as pk
from problems import tringali_2020
from studies.benchmarks.reliability.good_runs import KINDS
from studies.benchmarks.reliability.verifier import FAULTS, FORGERIES, LIMITED, edit, forge

QUICK = ("search", "closed loop", "polygon")


def subjects(rows):
    return {row.subject for row in rows}


def parameters(names, kind_of):
    return [pytest.param(name, marks=[] if kind_of(name) in QUICK else pytest.mark.slow) for name in names]


@pytest.mark.parametrize("kind", parameters(KINDS, str))
def test_a_good_run_passes_and_says_what_nobody_looked_at(good_run, kind):
    folder, _, subject = good_run(kind)
    verification = pk.verify(folder, subject)
    assert verification.failures == ()
    assert len(repr(verification).splitlines()) <= 40
    assert all(row.detail for row in verification.unchecked)


@pytest.mark.parametrize("fault", parameters(FAULTS, lambda name: FAULTS[name][0]))
def test_a_planted_fault_is_caught_and_named(good_run, tmp_path, fault):
    kind, change, failing = FAULTS[fault]
    folder, _, subject = good_run(kind)
    verification = pk.verify(edit(folder, tmp_path / "edited", change), subject)
    assert failing in subjects(verification.failures)
    assert all(row.detail and "\n" not in row.detail for row in verification.failures)


@pytest.mark.parametrize("forgery", parameters(FORGERIES, lambda name: FORGERIES[name][0]))
def test_a_run_given_out_as_one_of_a_stricter_problem_is_caught_by_what_it_does_not_keep_alone(
    good_run, tmp_path, forgery
):
    kind, stricter, failing = FORGERIES[forgery]
    folder, problem, _ = good_run(kind)
    other = stricter(pk.load_front(folder, problem))
    failed = subjects(pk.verify(forge(folder, tmp_path / "forged", other), other).failures)
    assert failing in failed
    limits = {f"{limit} limits" for limit in LIMITED}
    assert {"tracking at samples", "objective torque_norm", "clearance at samples", *limits} & failed <= {failing}


def test_an_edit_without_new_digests_is_caught(good_run, tmp_path):
    folder, problem, _ = good_run("search")
    copy = edit(folder, tmp_path / "copy", lambda run: None)
    text = (copy / "run.json").read_text()
    (copy / "run.json").write_text(re.sub(r'"seed": 1\b', '"seed": 2', text, count=1))
    assert text != (copy / "run.json").read_text()
    assert "digests" in subjects(pk.verify(copy, problem).failures)


def test_without_its_problem_a_run_is_checked_by_itself_and_says_what_is_missing(good_run):
    verification = pk.verify(good_run("search")[0])
    assert verification.passed
    assert "motions against the problem" in subjects(verification.unchecked)
    assert not verification.verified
    assert "verified" not in repr(verification)


def test_a_folder_without_a_run_is_refused(tmp_path):
    with pytest.raises(pk.InvalidInput, match="no such file"):
        pk.verify(tmp_path)


def test_without_pinocchio_the_tables_are_checked_and_the_headline_says_what_to_install(good_run, monkeypatch):
    folder, problem, _ = good_run("search")
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    verification = pk.verify(folder, problem)
    assert verification.passed
    assert not verification.verified
    assert "1 not made: motions against the problem (Pinocchio" in verification.headline
    assert "paretoik[verify]" in verification.headline
    assert "verified" not in verification.headline


def test_the_command_prints_rows_and_ends_with_its_own_exit_code(good_run, tmp_path):
    folder, *_ = good_run("search")
    edited = edit(folder, tmp_path / "edited", FAULTS["an id twice"][1])
    command = [sys.executable, "-m", "paretoik", "verify"]
    problem = ["--problem", "studies/benchmarks/reliability/good_runs.py:tracking"]
    good = subprocess.run([*command, folder, "--json", *problem], capture_output=True, text=True, check=False)
    bad = subprocess.run([*command, edited], capture_output=True, text=True, check=False)
    assert (good.returncode, bad.returncode) == (0, 7)
    assert json.loads(good.stdout)["passed"] is True
    assert "an id is in the table twice" in bad.stdout
    assert "verification" in good.stderr


def test_an_observer_learns_how_many_points_are_checked(good_run):
    folder, problem, _ = good_run("search")
    shown = []
    count = len(pk.verify(folder, problem, observe=shown.append).rows)
    points = len(pk.load_front(folder, problem))
    verified = [progress for progress in shown if progress.stage == "verification"]
    assert [(progress.done, progress.total) for progress in verified] == [(k, points) for k in range(points + 1)]
    assert len(pk.verify(folder, problem, observe=False).rows) == count


def test_an_observer_that_raises_ends_the_verification_at_once(good_run):
    folder, problem, _ = good_run("search")
    shown = []

    def watch(progress):
        shown.append(progress.done)
        raise LookupError("no more")

    with pytest.raises(pk.InvalidInput, match="observe raised LookupError: no more"):
        pk.verify(folder, problem, observe=watch)
    assert shown == [0]
    assert pk.verify(folder, problem, observe=False).rows  # no flag is left


@pk.objective(unit="rad", form="integral")
def turning(motion):
    return np.abs(motion.dq[..., 0])


@pk.constraint(unit="N m s", form="integral", upper=10.0)
def pushing(motion):
    return np.maximum(motion.torque[..., 0], 0.0)


def test_integrals_with_kinks_are_right_as_they_are_stated(tmp_path):
    kinked = [pk.joint_travel, pk.mechanical_energy, pk.joint_limit_nearness, pk.velocity_limit_nearness, turning]
    limits = pk.Limits(position=np.deg2rad([90.0, 120.0, 120.0]), velocity=6.0)
    arm = replace(pk.arms.tringali_3r(), velocity_limits=np.full(3, 6.0))
    problem = pk.Tracking(
        arm,
        tringali_2020.straight(15),
        objectives=[*kinked, pk.manipulability],
        constraints=[pushing],
        limits=limits,
        bases=1,
    )
    pk.solve(problem, population=8, generations=2, seed=1, out=tmp_path / "run", observe=False)
    verified = pk.verify(tmp_path / "run", problem, observe=False)
    assert [(each.subject, each.detail) for each in verified.failures] == []
    motion = pk.load_front(tmp_path / "run", problem).motions[0]
    for objective in kinked:
        curve = objective.function(motion.instants)  # the stated value is not the curve's
        assert motion.instants.integral(curve) != pytest.approx(objective(motion), rel=1e-9)
    of_curve = motion.instants.integral(pk.manipulability.function(motion.instants))
    assert pk.manipulability(motion) == pytest.approx(of_curve, rel=1e-12)

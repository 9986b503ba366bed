"""Signals end every verb soon, and the results so far are returned."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import paretoik as pk
from paretoik.stop_flag import STOP
from paretoik.trajectory.plan_starts import RestartPolicy
from problems import tringali_2020

ROOT = Path(__file__).parents[2]
BOTH = (pk.kinetic_energy, pk.torque_norm)


def tracking(*objectives):
    limits = pk.Limits(position=tringali_2020.POSITION, velocity=tringali_2020.VELOCITY)
    return pk.Tracking(pk.arms.tringali_3r(), tringali_2020.straight(103), objectives=objectives, limits=limits)


def interrupt_at(stage, done=1, number=signal.SIGINT):
    """Return an observer that sends this process a signal when a stage has come so far."""

    def observe(progress):
        if progress.stage == stage and progress.done >= done and not STOP[0]:
            os.kill(os.getpid(), number)

    return observe


def test_a_plan_returns_the_optima_of_coarser_samples_at_its_own():
    problem = tracking(pk.kinetic_energy)
    whole = pk.plan(problem, starts=8)
    plan = pk.plan(problem, starts=8, observe=interrupt_at("sample"))
    assert not STOP[0]
    assert {optimum.status for optimum in plan.optima} == {"interrupted"}
    assert len(plan.levels) == 1
    assert plan.best.motion.q.shape == whole.best.motion.q.shape
    assert plan.best.motion.tracking_error.max() <= 1e-9
    assert plan.best.objective == pytest.approx(whole.best.objective, rel=0.05)


def interrupt_restarts(monkeypatch):
    """Send this process a signal when the first part of a plan's starts is done."""
    add = RestartPolicy.__call__

    def interrupted(policy, solutions):
        os.kill(os.getpid(), signal.SIGINT)
        return add(policy, solutions)

    monkeypatch.setattr(RestartPolicy, "__call__", interrupted)


def test_a_plan_counts_its_starts_even_on_an_interrupted_level(monkeypatch, tmp_path):
    problem = tracking(pk.kinetic_energy)
    whole = pk.plan(problem, starts=8)
    assert whole.starts >= 8
    assert whole.provenance["counts"]["starts"] == whole.starts
    interrupt_restarts(monkeypatch)
    plan = pk.plan(problem, out=tmp_path)
    assert (plan.levels, plan.provenance["status"]) == ((), "SIGINT")
    assert 12 <= plan.starts < 48
    assert plan.provenance["counts"]["starts"] == plan.starts == pk.load_plan(tmp_path, problem).starts


@pytest.mark.parametrize(("stage", "least"), [("optimum", 1), ("point", 3), ("certification", 6)])
def test_an_epsilon_front_returns_the_points_so_far_and_says_which_are_certified(stage, least):
    front = pk.epsilon_front(tracking(*BOTH), points=6, starts=6, observe=interrupt_at(stage, 3, signal.SIGTERM))
    assert front.provenance["status"] == "SIGTERM"
    assert front.provenance["counts"]["seconds"] > 0
    assert len(front) >= min(least, 6)
    assert front.motions.tracking_error.max() <= 1e-9
    late = front.certificates.reason == "interrupted before it was certified"
    assert late.sum() == len(front) - 3 if stage == "certification" else late.all()
    assert (front.certificates.status[late] == "undetermined").all()
    assert np.isnan(front.certificates.criticality[late]).all()


def test_an_interrupted_refinement_keeps_its_refined_points():
    front = pk.solve(tracking(*BOTH), population=30, generations=6, seed=1, points=12)
    refined = pk.refine(front, observe=interrupt_at("refinement"))
    assert refined.provenance["status"] == "SIGINT"
    assert 0 < refined.provenance["counts"]["converged"] <= 4
    assert refined.provenance["counts"]["seconds"] > 0
    assert set(refined.ids) <= set(front.ids)


@pytest.mark.parametrize(("number", "error"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, SystemExit)])
def test_a_signal_before_any_result_ends_python_as_usual(number, error, monkeypatch):
    module = import_module("paretoik.formulations.tracking")
    find_optima = module.find_optima

    def interrupted(*arguments, **settings):
        os.kill(os.getpid(), number)
        return find_optima(*arguments, **settings)

    monkeypatch.setattr(module, "find_optima", interrupted)
    handlers = [signal.getsignal(which) for which in (signal.SIGINT, signal.SIGTERM)]
    with pytest.raises(error) as ended:
        pk.plan(tracking(pk.kinetic_energy), starts=4)
    assert number == signal.SIGINT or ended.value.code == 143
    assert [signal.getsignal(which) for which in (signal.SIGINT, signal.SIGTERM)] == handlers
    assert not STOP[0]


PANDA = """
import sys, time
import paretoik as pk
from problems import panda

verb, problem = sys.argv[1], panda.across_the_table()
def show(progress):
    print(progress.stage, flush=True)

if verb == "plan":
    task = problem.task
    problem = pk.Tracking(task.arm, task.tasks, objectives=[pk.kinetic_energy])
subject = pk.solve(problem, population=60, generations=10, points=20, seed=1) if verb == "refine" else problem
try:
    result = getattr(pk, verb)(subject, observe=show)
    print("ended", time.process_time(), len(result.optima if verb == "plan" else result), flush=True)
except KeyboardInterrupt:
    print("ended", time.process_time(), 0, flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(("verb", "delay"), [("plan", 0.0), ("epsilon_front", 10.0), ("refine", 1.0)])
def test_a_verb_on_a_seven_joint_arm_answers_within_a_second_of_its_processors_time(verb, delay, number):
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", PANDA, verb]
    with subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:  # up to its first stage: everything is imported and compiled
            if line.strip() in ("sample", "optimum", "refinement"):
                break
        time.sleep(delay)
        before = processor_seconds(process.pid)
        process.send_signal(number)
        rest = process.stdout.read()
    assert process.returncode == 0
    after, count = re.search(r"ended (\S+) (\d+)", rest).groups()
    assert int(count) > 0
    assert float(after) - before < 1.0


def processor_seconds(process: int) -> float:
    """Return the processor time of a process [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

"""Refinement adds samples until values are those of the curves; the result still belongs to the user's problem."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from importlib import import_module
from itertools import pairwise

import numpy as np
import pytest

import paretoik as pk
from paretoik.api.result import save_plan
from paretoik.front.points import confirmation_text
from paretoik.nlp.program import ITERATION_LIMIT
from paretoik.stop_flag import STOP
from paretoik.task.motion_task import SAMPLES, finer_motion

LEVELS = import_module("paretoik.trajectory.levels")
OBJECTIVES = {
    "integral": [pk.kinetic_energy, pk.torque_norm],
    "peak": [pk.kinetic_energy, pk.peak_velocity],
    "kinks": [pk.kinetic_energy, pk.joint_travel],
}


def planar(seed, objectives):
    """Return a random 3R arm that follows a fast line of few samples."""
    rng = np.random.default_rng(seed)
    arm = pk.Arm.planar(lengths=rng.uniform(0.2, 0.5, 3), masses=rng.uniform(0.5, 2.0, 3))
    reach = float(arm.pose(np.zeros(3)).position[0])
    angle, turn = rng.uniform(-np.pi, np.pi), rng.uniform(0.5, 1.2) * rng.choice([-1, 1])
    ends = [r * reach * np.array([np.cos(a), np.sin(a)]) for r, a in ((0.6, angle), (0.7, angle + turn))]
    path = pk.line(*ends, duration=float(rng.uniform(0.3, 0.8)), samples=int(rng.integers(6, 10)))
    return pk.Tracking(arm, path, objectives=objectives)


def on_curves(motions, objectives):
    """Return the values of motions on a grid 200 times finer (points, n_obj)."""
    fine = finer_motion(motions, 200)
    return np.stack([each(fine) for each in objectives], axis=1)


def check_front(front, problem, folder):
    """Check that minima have the values of their curves, and the run is the user's own problem's."""
    minima = front.certificates.status == "minimum"
    assert minima.any()
    errors = np.abs(on_curves(front.motions, problem.task.objectives) - front.objectives)
    sizes = np.maximum(np.abs(front.objectives), np.ptp(front.objectives, axis=0))
    assert (errors / sizes)[minima].max() <= 1e-3
    before, after = (len(each.task.times) for each in (problem, front.problem))
    assert front.provenance["samples"] == {"path": before, "used": after}
    assert front.motions.q.shape[1] == after > before
    assert np.isin(problem.task.times, front.problem.task.times).all()
    loaded = pk.load_front(folder, problem)
    np.testing.assert_array_equal(loaded.motions.q, front.motions.q)
    np.testing.assert_array_equal(loaded.problem.task.times, front.problem.task.times)
    assert pk.verify(folder, problem).passed
    return loaded


def test_a_coarse_front_gets_samples_until_its_minima_have_the_values_of_their_curves(tmp_path):
    problem = planar(2, OBJECTIVES["integral"])
    told = []
    front = pk.epsilon_front(problem, points=2, starts=2, observe=told.append)
    front.save(tmp_path / "run")
    loaded = check_front(front, problem, tmp_path / "run")
    used, given = front.problem.task.times.size, problem.task.times.size
    assert any(each.summary.startswith(f"on {used} samples") for each in told)
    assert f"on {used} samples: with the path's {given}, a value was over 0.1 %" in confirmation_text(loaded.provenance)
    again = pk.refine(loaded, problem)
    assert again.problem.task.times.size == used
    np.testing.assert_allclose(again.objectives, front.objectives, rtol=1e-5)
    genes, miss = problem.encode(front.motions)
    assert len(genes) == len(miss) == len(front)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3, 9))
@pytest.mark.parametrize("kind", OBJECTIVES)
def test_random_coarse_fronts_get_samples(kind, seed, tmp_path):
    problem = planar(seed, OBJECTIVES[kind])
    front = pk.epsilon_front(problem, points=5, starts=6, out=tmp_path / "run")
    loaded = check_front(front, problem, tmp_path / "run")
    moved = loaded.navigate(int(loaded.ids[-1]), improve="kinetic_energy")
    assert moved.motions.q.shape[1] == front.motions.q.shape[1]


@pytest.fixture(scope="module")
def searched():
    problem = planar(4, OBJECTIVES["peak"])
    return pk.solve(problem, population=20, generations=6, points=5)


def test_a_refined_point_is_no_worse_on_its_curve_than_it_was(searched):
    refined = pk.refine(searched)
    row = {number: i for i, number in enumerate(searched.ids.tolist())}
    before = searched.motions[[row[number] for number in refined.ids.tolist()]]
    objectives = searched.problem.task.objectives
    rise = on_curves(refined.motions, objectives) - on_curves(before, objectives)
    assert refined.motions.q.shape[1] > searched.motions.q.shape[1]
    assert rise.max() <= 1e-3 * np.abs(refined.objectives).max()
    assert (rise.max(axis=1) < 0).any()


@pytest.mark.parametrize("ending", ["signal", "observer"])
def test_what_was_found_before_stays_if_samples_are_cut_short(searched, ending):
    def observe(progress):
        finer = progress.stage == "refinement" and progress.summary.startswith("on ")
        if finer and ending == "signal" and not STOP[0]:
            os.kill(os.getpid(), signal.SIGINT)
        return finer and ending == "observer"

    front = pk.refine(searched, observe=observe)
    assert front.provenance["status"] == ("SIGINT" if ending == "signal" else "refined")
    assert front.problem is searched.problem
    assert "under-resolved" in front.certificates.status
    assert set(front.certificates.status) <= {"minimum", "under-resolved"}
    assert np.isfinite(front.certificates.criticality).all()


@pytest.mark.slow
def test_a_run_that_is_stopped_while_samples_are_added_resumes_bit_for_bit(searched, tmp_path):
    def observe(progress):
        if progress.stage == "certification" and progress.summary.startswith("on ") and not STOP[0]:
            os.kill(os.getpid(), signal.SIGINT)

    whole = pk.refine(searched)
    stopped = pk.refine(searched, out=tmp_path / "run", observe=observe)
    assert stopped.motions.q.shape[1] < whole.motions.q.shape[1]
    resumed = pk.resume(tmp_path / "run", searched.problem)
    np.testing.assert_array_equal(resumed.motions.q, whole.motions.q)
    np.testing.assert_array_equal(resumed.certificates.status, whole.certificates.status)


def test_a_plan_gets_samples_and_says_so(tmp_path):
    problem = planar(5, [pk.peak_velocity])
    plan = pk.plan(problem, starts=3)
    save_plan(plan, tmp_path, name="peak_velocity", unit="rad/s", maximised=False)
    assert {each.status for each in plan.optima} == {"converged"}
    for each in plan.optima:
        value = float(problem.task.objectives[0](finer_motion(each.motion, 200)))
        assert each.objective == pytest.approx(value, rel=1e-3)
    samples = [count for count, _ in plan.levels]
    assert plan.provenance["samples"] == {"path": len(problem.task.times), "used": samples[-1]}
    assert all(later in (2 * count - 1, count) for count, later in pairwise(samples))
    loaded = pk.load_plan(tmp_path, problem)
    np.testing.assert_array_equal(loaded.best.motion.q, plan.best.motion.q)
    assert pk.verify(tmp_path, problem).passed
    warm = pk.plan(problem, starts=1, initial=plan.best.motion)
    assert warm.best.objective <= plan.best.objective * (1 + 1e-3)


def test_a_value_that_stays_off_its_curve_stays_under_resolved(monkeypatch):
    problem = planar(5, [pk.peak_velocity])
    monkeypatch.setattr(LEVELS, "SAMPLES", replace(SAMPLES, doublings=0))
    plan = pk.plan(problem, starts=3)
    assert "under-resolved" in {each.status for each in plan.optima}
    assert "samples" not in plan.provenance


def test_a_plan_stays_if_no_optimum_converges_on_more_samples(monkeypatch):
    def fail(program, *rest, **settings):
        ends = minimise_from(program, *rest, **settings)
        return replace(ends, status=np.full(len(ends), ITERATION_LIMIT)) if len(program.task.times) > before else ends

    planning = import_module("paretoik.trajectory.plan")
    minimise_from, problem = planning.minimise_from, planar(5, [pk.peak_velocity])
    before = len(problem.task.times)
    monkeypatch.setattr(planning, "minimise_from", fail)
    plan = pk.plan(problem, starts=3)
    assert plan.best.motion.q.shape[0] == before
    assert "samples" not in plan.provenance


def test_an_optimum_that_does_not_converge_on_more_samples_keeps_none_from_the_others():
    rng = np.random.default_rng(9)
    arm = pk.Arm.planar(lengths=rng.uniform(0.2, 0.5, 4), masses=rng.uniform(0.5, 2.0, 4))
    path = pk.line([-0.650, -0.202], [-0.205, -0.595], duration=1.0, samples=8)
    plan = pk.plan(pk.Tracking(arm, path, objectives=[pk.torque_norm]), starts=3)
    statuses = [each.status for each in plan.optima]
    assert len(plan.levels) == 1 + SAMPLES.doublings
    assert statuses.count("converged") > len(statuses) / 2

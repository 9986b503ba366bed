from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from tests.api.problems import PATH, tracking


def test_levels_are_shown_coarse_to_fine_with_starts_and_optima():
    seen = []
    plan = pk.plan(tracking(pk.kinetic_energy), starts=6, observe=seen.append)
    seen = [progress for progress in seen if progress.stage != "compilation"]  # if nothing was compiled before
    samples = len(PATH.times)
    assert {(progress.stage, progress.total) for progress in seen} == {("sample", samples)}
    assert [progress.done for progress in seen] == sorted(progress.done for progress in seen)
    assert seen[-1].done == samples
    assert seen[-1].summary.endswith(f"{len(plan.optima)} distinct optima")


@pytest.mark.parametrize("find", [pk.plan, pk.epsilon_front])
def test_the_limit_that_fails_is_shown_before_the_last_start_fails(find):
    seen = []
    objectives = [pk.kinetic_energy] if find is pk.plan else [pk.kinetic_energy, pk.torque_norm]
    with pytest.raises(pk.Infeasible) as failure:
        find(tracking(*objectives, velocity=0.05), starts=4, seed=0, observe=seen.append)
    shown = [progress.summary for progress in seen if progress.done]
    assert failure.value.limit.startswith("velocity of ")
    assert all("no motion within the limits so far; of the least-violating one, velocity of " in each for each in shown)
    assert shown


def test_motions_of_another_length_or_off_the_path_cannot_be_started_from():
    one = tracking(pk.kinetic_energy)
    motions = one.decode(np.array([[0.5, *np.zeros(one.n_var - 1)]]))
    with pytest.raises(pk.InvalidInput, match=r"initial must be motions of .* with 21 samples, got .* with 20"):
        pk.plan(one, initial=one.task.truncate(20).motion(motions.q[:, :20]))
    with pytest.raises(pk.InvalidInput, match="initial must be motions on the path, got some that are"):
        pk.plan(one, initial=one.task.motion(motions.q + 0.1))


def test_what_cannot_be_planned_is_refused_before_any_work():
    arm, motors = pk.arms.kim_3r(), pk.capability.kim_joint_motors()
    way = pk.PointToPoint(arm, motors, (0.1, -0.15), (0.2, -0.15), samples=9, coefficients=5, bases=4)
    with pytest.raises(pk.InvalidInput, match="problem must be a Tracking, got PointToPoint; epsilon_front or solve"):
        pk.plan(way)
    with pytest.raises(pk.InvalidInput, match="plan: the problem must have gradients, as Tracking has, got Tuning"):
        pk.plan(pk.Tuning(pk.arms.tringali_3r(), PATH, pk.methods.DampedLeastSquares(), judged_starts=1))


@pytest.mark.parametrize("solver", ["auto", "sqp"])
def test_every_optimum_of_a_plan_is_confirmed_and_the_run_keeps_by_whom(solver, tmp_path):
    problem = tracking(pk.kinetic_energy)
    plan = pk.plan(problem, starts=3, solver=solver, out=tmp_path / "run")
    loaded = pk.load_plan(tmp_path / "run", problem)
    names, count = {"auto": "interior-point", "sqp": "sqp"}, len(plan.optima)
    entry = {"refinement": names[solver], "criticality": "cvxpy, Clarabel", "confirmed": count, "points": count}
    assert plan.provenance["solvers"] == loaded.provenance["solvers"] == entry
    assert [each.criticality for each in loaded.optima] == [each.criticality for each in plan.optima]
    assert 0 <= max(each.criticality for each in plan.optima) <= 1e-6

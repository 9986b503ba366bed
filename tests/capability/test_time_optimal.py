"""Plans whose claims are nearly true, and control that arrives when the fastest path does."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from paretoik.capability import time_optimal as planner
from paretoik.capability.geodesic import fastest_path, path_time
from paretoik.capability.time_optimal import Planner, time_optimal_control
from paretoik.errors import InvalidInput, SolverFailed
from tests.capability.test_geodesic import Even, HalfPlane, Ridge, Waves, ends, lattice_time


def fastest_plan(model, start, target, horizon=10, formulation="midpoint"):
    looking_ahead = Planner(model, horizon=horizon, formulation=formulation)
    return looking_ahead.plan(looking_ahead.initial_points(np.asarray(start), np.asarray(target)))


@pytest.mark.parametrize("task", [2, 3])
def test_at_even_speed_a_plan_is_exact(task):
    root, (start, target) = np.random.default_rng(task).normal(size=(task, task)), ends(task, task)
    plan = fastest_plan(Even(root, np.zeros(task), np.ones(task)), start, target)
    exact = np.linalg.norm(root @ (target - start))
    assert plan.time_to_go == pytest.approx(exact, rel=1e-9)
    assert plan.velocity == pytest.approx((target - start) / exact, rel=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_a_plan_of_ten_pieces_claims_nearly_what_its_path_takes(seed):
    model, (start, target) = Waves(seed), ends(seed)
    plan, fastest = fastest_plan(model, start, target), fastest_path(model, start, target).duration
    true = path_time(model, plan.points)
    assert plan.time_to_go == pytest.approx(true, rel=0.02)
    assert fastest * (1 - 1e-6) <= true <= 1.02 * fastest
    assert np.ptp(plan.intervals) == 0.0


@pytest.mark.parametrize(
    ("model", "start", "target", "columns"), [(Waves(1), (4, 6), (35, 30), 41), (Ridge(), (4, 50), (36, 50), 101)]
)
def test_plans_and_control_take_as_long_as_the_best_way_along_a_lattice(model, start, target, columns):
    """Plans start from the fastest path, so they cannot test it; a lattice is independent of it."""
    duration = lattice_time(model, start, target, 41, columns)
    ends = [model.lower + np.divide(end, (40, columns - 1)) * (model.upper - model.lower) for end in (start, target)]
    plan, run = fastest_plan(model, *ends), time_optimal_control(model, *ends, period=1e-2)
    assert [path_time(model, plan.points), plan.time_to_go, run.arrival] == pytest.approx([duration] * 3, rel=0.01)


def test_as_printed_a_plan_jumps_over_what_is_slow():
    model, start, target = HalfPlane(), np.array([1.0, 3.0]), np.array([-1.0, 0.2])
    printed = fastest_plan(model, start, target, formulation="printed")
    honest = fastest_plan(model, start, target)
    assert printed.time_to_go < 0.4 * path_time(model, printed.points)
    assert printed.time_to_go < 0.4 * model.time(start, target)
    assert honest.time_to_go == pytest.approx(path_time(model, honest.points), rel=0.01)
    assert path_time(model, honest.points) == pytest.approx(model.time(start, target), rel=2e-3)


@cache
def run_down(formulation="midpoint"):
    return time_optimal_control(HalfPlane(), [1.0, 3.0], [-1.0, 0.2], period=1e-2, formulation=formulation)


def test_control_arrives_when_the_fastest_path_does():
    """At constant velocity over a period T a reference gains or loses at most T/2 for each e-fold of speed: ln 15."""
    exact, period = HalfPlane().time(np.array([1.0, 3.0]), np.array([-1.0, 0.2])), 1e-2
    run = run_down()
    assert exact - 1.4 * period <= run.arrival <= 1.005 * exact + 1.4 * period
    assert path_time(HalfPlane(), run.references) == pytest.approx(run.arrival, abs=2.4 * period)
    assert run.settled == run.arrival
    assert run.cuts == 0
    assert run.to_go == pytest.approx(run.arrival - run.times[: len(run.to_go)], abs=0.03)


def test_control_follows_a_wall():
    model, start, target = HalfPlane(top=1.2), [-1.0, 1.0], [1.0, 1.0]
    run = time_optimal_control(model, start, target, period=5e-3)
    assert run.references[:, 1].max() <= 1.2
    assert run.arrival == pytest.approx(fastest_path(model, start, target).duration, abs=2 * 5e-3)


def test_control_as_printed_loses_what_it_claims():
    run = run_down("printed")
    assert run.to_go[0] < 0.4 * run.arrival
    assert run.arrival > 1.05 * run_down().arrival


def test_a_plan_from_the_last_one_takes_one_cone_program():
    start, target = ends(1)
    run = time_optimal_control(Waves(1), start, (start + target) / 2)
    assert len(run.iterations) > 100
    assert np.quantile(run.iterations, 0.95) == 1


def test_the_tool_keeps_its_limits_and_makes_up_for_a_wrong_start():
    model, (start, target) = Waves(1, 3), ends(1, 3)
    run = time_optimal_control(model, start, target, period=5e-3, initial=start + 0.02)
    near = time_optimal_control(model, start, target, period=5e-3)
    speeds = np.linalg.norm(np.einsum("nij,nj->ni", model.roots(run.positions[:-1])[0], run.velocities), axis=1)
    assert speeds.max() <= 1 + 1e-9
    assert np.diff(run.positions, axis=0) == pytest.approx(5e-3 * run.velocities, abs=1e-12)
    assert np.linalg.norm(run.positions[-1] - target) <= 1e-6 < np.linalg.norm(run.positions[-2] - target)
    assert run.arrival == near.arrival
    assert run.settled > run.arrival
    apart = np.linalg.norm(run.positions[:, None] - run.references, axis=2).min(axis=1)
    assert apart[run.times > 0.6 * run.arrival].max() < 2e-3 < 0.01 < apart[0]  # it reaches the way before it settles
    assert run.cuts > 0
    assert np.array_equal(run.references[-1], target)
    assert np.array_equal(run.references[0], start)


HERE, THERE = [0.0, 1.0], [1.0, 1.0]
WRONG = {
    "target: must have shape": {"target": [1.0, 1.0, 1.0]},
    "initial: coordinate 1 must be in the model's box": {"initial": [0.0, 30.0]},
    "gain must be at most 1 / period": {"gain": 2000.0},
    "formulation must be one of midpoint, printed": {"formulation": "printd"},
}


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("message", WRONG)
def test_what_cannot_be_used_is_refused_by_name(message):
    with pytest.raises(InvalidInput, match=message):
        time_optimal_control(HalfPlane(), **{"start": HERE, "target": THERE, **WRONG[message]})


def test_what_does_not_converge_says_so(monkeypatch):
    monkeypatch.setattr(planner, "OPTIONS", planner.PlannerOptions(iterations=1))
    with pytest.raises(SolverFailed, match=r"plan from \[1 3\] m: must converge within 1 iterations"):
        fastest_plan(HalfPlane(), [1.0, 3.0], [-1.0, 0.2], formulation="printed")

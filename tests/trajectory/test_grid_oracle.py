"""Laws of the grid oracle: it is the best on its grid, satisfies all limits, and finds the planner's optima."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import paretoik as pk
from paretoik import Limits, Pose, circle, kinetic_energy, line, torque_norm
from paretoik.collision.obstacles import Circle
from paretoik.errors import Infeasible, InvalidInput
from paretoik.robot.arms import tringali_3r
from paretoik.task.random_starts import rollout_starts, sample_postures
from paretoik.trajectory import grid_oracle as module
from paretoik.trajectory.grid_oracle import grid_oracle
from tests.formulations.problems import panda
from tests.task.tasks import task

LINE = line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=26)
ROUND = circle([0.4178, 0.0], 0.05, duration=1.0, samples=26)
POSITION = np.deg2rad([90.0, 120.0, 120.0])


def task_of(path=LINE, arm=None, **changed):
    return task(path, arm or tringali_3r(), **changed)


def short(samples=4):
    return line([0.35, 0.05], [0.3, 0.1], duration=1.0, samples=samples)


@cache
def along_the_line():
    return grid_oracle(task_of())


def problem_of_the_line():
    return pk.Tracking(tringali_3r(), LINE, objectives=[kinetic_energy], differences="backward")


@cache
def planned():
    return pk.plan(problem_of_the_line(), starts=24)


def captured(monkeypatch, name):
    """Return a list that collects the grids of the graphs that ``name`` makes."""
    grids, make = [], getattr(module, name)

    def recorded(task, grid, terms):
        grids.append(grid)
        return make(task, grid, terms)

    monkeypatch.setattr(module, name, recorded)
    return grids


def every_motion(grid):
    """Return all motions through the nodes of a small grid."""
    ways = np.indices([len(nodes) for nodes in grid.nodes]).reshape(len(grid.nodes), -1)
    q = np.stack([nodes[way] for nodes, way in zip(grid.nodes, ways, strict=True)], axis=1)
    return np.cumsum(np.concatenate([q[:, :1], grid.step(q[:, 1:], q[:, :-1])], axis=1), axis=1)


@pytest.mark.parametrize(("objective", "graph"), [(kinetic_energy, "_node_graph"), (torque_norm, "_pair_graph")])
def test_no_way_through_the_grid_is_better(monkeypatch, objective, graph):
    grids = captured(monkeypatch, graph)
    task = task_of(short(3), objectives=[objective])
    oracle = grid_oracle(task, resolution=0.15)
    q = every_motion(grids[0])
    q = q[(np.abs(np.diff(q, axis=1)) <= grids[0].windows[1:]).all(axis=(1, 2))]
    if objective is torque_norm:  # accelerations count: second differences have windows, too
        q = q[(np.abs(np.diff(q, n=2, axis=1)) <= grids[0].windows[2:] / 2).all(axis=(1, 2))]
    assert len(q) > 20
    assert oracle.best == pytest.approx(objective(task.motion(q)).min(), rel=1e-12)


@pk.objective(unit="rad", form="integral")
def speed(motion):
    return np.sum(np.abs(motion.dq), axis=-1)


@pk.objective(unit="rad s", form="integral")
def from_a_posture(motion):
    return np.sum(np.abs(motion.q - [0.3, -1.1, 1.7]), axis=-1)


@pk.constraint(unit="m", upper=0.08)
def low_elbow(motion):
    return motion.links[..., 1, 1]


START = np.array([0.2, -1.0, 1.2])
BOUNDED = [
    {},
    {"objectives": [speed, from_a_posture]},
    {"limits": Limits(velocity=1.5)},
    {"constraints": [low_elbow], "obstacles": [Circle([0.1, -0.12], 0.03)]},
    {"start": START},
]


@pytest.mark.parametrize("changed", BOUNDED)
def test_no_finer_grid_comes_below_the_lower_bound(changed):
    begin = task_of().motion(np.tile(START, (26, 1))).links[0, -1, :2]
    task = task_of(line(begin, [0.3, 0.1], duration=1.0, samples=11), **changed)
    oracle, finer = (grid_oracle(task, resolution=h) for h in (0.04, 0.02))
    assert oracle.lower_bound < min(oracle.best, finer.best)
    assert oracle.lower_bound < finer.lower_bound


@pytest.mark.parametrize(
    ("limits", "samples", "resolution"), [(None, 11, 0.06), (Limits(position=POSITION, velocity=3.2), 26, 0.02)]
)
def test_the_lower_bound_comes_near_as_nodes_move_together(limits, samples, resolution):
    task = task_of(line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=samples), limits=limits)
    oracles = [grid_oracle(task, resolution=h) for h in (resolution, resolution / 2)]
    gaps = [1 - one.lower_bound / one.best for one in oracles]
    assert gaps[1] < 0.4 * gaps[0] < 0.02


def test_the_planner_finds_nothing_that_the_oracle_does_not_know_of():
    oracle = along_the_line()
    plan = planned()
    assert oracle.exact
    assert oracle.lower_bound < plan.best.objective < oracle.best < 1.02 * plan.best.objective
    assert oracle.labels[0] == plan.best.label


def test_refining_what_the_oracle_found_ends_at_every_optimum_of_the_planner():
    problem = problem_of_the_line()
    led = pk.plan(problem, starts=1, initial=problem.task.motion(along_the_line().q))
    reached = np.array([optimum.objective for optimum in led.optima])
    for optimum in planned().optima:
        assert np.abs(reached / optimum.objective - 1).min() < 1e-8


def test_motions_follow_the_path_and_are_worth_what_is_said():
    oracle, task = along_the_line(), task_of()
    motions = task.motion(oracle.q)
    assert motions.tracking_error.max() < 1e-9
    np.testing.assert_allclose(kinetic_energy(motions), oracle.values, rtol=1e-12)
    assert (np.diff(oracle.values) >= 0).all()
    assert len(set(oracle.labels)) > 3


def test_limits_on_positions_and_velocities_are_kept_and_cost():
    limits = Limits(position=POSITION, velocity=3.2)
    oracle = grid_oracle(task_of(limits=limits))
    assert oracle.exact
    assert oracle.violations.max() <= 1e-9
    motion = task_of(limits=limits).motion(oracle.q)
    assert np.abs(motion.dq).max() <= 3.2 * (1 + 1e-8)
    assert (np.abs(motion.q) <= POSITION + 1e-9).all()
    assert oracle.best > along_the_line().best


def test_a_limit_on_torques_holds_at_the_grids_samples_and_makes_it_inexact():
    task = task_of(short(11), limits=Limits(torque=0.03))
    oracle = grid_oracle(task, resolution=0.02)
    assert not oracle.exact
    assert np.isnan(oracle.lower_bound)
    assert oracle.samples == 11
    assert np.abs(task.motion(oracle.q).torque).max() <= 0.03 * (1 + 1e-8)


@pytest.mark.parametrize("measure", [kinetic_energy, torque_norm])
def test_a_cycle_closes_to_the_bit(measure):
    task = task_of(ROUND, cyclic=True, objectives=[measure], limits=Limits(position=POSITION, velocity=3.8))
    oracle = grid_oracle(task, resolution=0.03)
    np.testing.assert_array_equal(oracle.q[:, 0], oracle.q[:, -1])
    assert task.motion(oracle.q).tracking_error.max() < 1e-9
    assert oracle.violations[0] <= 1e-9


def test_motions_begin_at_the_given_start_to_the_bit():
    start = sample_postures(task_of(), 40, np.random.default_rng(0))[0] + [2 * np.pi, 0.0, 0.0]
    oracle = grid_oracle(task_of(start=start))
    np.testing.assert_array_equal(oracle.q[:, 0], np.tile(start, (len(oracle.q), 1)))
    assert oracle.best >= along_the_line().best * (1 - 1e-3)


def test_a_spatial_arm_follows_poses_within_its_own_limits():
    path = line(*(Pose.from_rpy((0.45, y, 0.3), (np.pi, 0, 0)) for y in (-0.05, 0.05)), duration=1.0, samples=6)
    task = task_of(path, panda(), limits=Limits(torque=np.inf))
    oracle = grid_oracle(task, resolution=0.08)
    assert task.motion(oracle.q).tracking_error.max() < 1e-9
    assert oracle.violations.max() <= 1e-9
    rolled = task.motion(rollout_starts(task, 60, np.random.default_rng(0)))
    feasible = task.violations(rolled).max(axis=1) <= 0
    assert feasible.sum() > 3
    assert oracle.best < kinetic_energy(rolled)[feasible].min()


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"differences": "central"}, "got central differences"),
        ({"end_velocity": 0.0}, "got end_velocity=0"),
        ({"objectives": [pk.joint_drift]}, "objective joint_drift: form must be 'integral'"),
        ({"objectives": [pk.jerk]}, "must be finite functions of q, dq and ddq, got NaN"),
    ],
)
def test_what_is_not_supported_is_refused_by_name(changed, said):
    with pytest.raises(InvalidInput, match=said):
        grid_oracle(task_of(**changed))


def test_a_grid_too_large_for_memory_is_refused(monkeypatch):
    monkeypatch.setattr(module, "OPTIONS", replace(module.OPTIONS, transitions=1000))
    with pytest.raises(InvalidInput, match="make it coarser"):
        grid_oracle(task_of(short()), resolution=0.01)


def test_limits_that_no_way_keeps_are_named_with_the_sample():
    with pytest.raises(Infeasible, match=r"no posture satisfies the limits at sample \d+"):
        grid_oracle(task_of(short(11), limits=Limits(position=0.05)), resolution=0.1)
    with pytest.raises(Infeasible, match=r"reaches sample \d+ of 11 .* within the limits"):
        grid_oracle(task_of(short(11), limits=Limits(velocity=0.05)), resolution=0.01)

"""Basin hopping: the best optima disturbed and recombined; none is lost, and better ones are found."""

from __future__ import annotations

import numpy as np

import paretoik as pk
from paretoik.nlp.minimise import minimise
from paretoik.task.starts import recombined_starts
from paretoik.trajectory import restarts as basin_hopping
from paretoik.trajectory.levels import OPTIONS as LEVELS
from paretoik.trajectory.levels import coarsest_level, objective_scales
from paretoik.trajectory.plan_starts import sample_starts
from paretoik.trajectory.program import joint_distance
from paretoik.trajectory.transcription import motion_program
from problems import tringali_2020


def test_recombined_optima_are_near_none_that_there_is():
    problem = pk.Tracking(
        pk.Arm.planar(lengths=[0.3] * 4, masses=[1.0] * 4, centers=[0.15] * 4),
        pk.line([0.9, 0.2], [-0.2, 0.5], duration=1.0, samples=26),
        objectives=[pk.torque_norm],
    )
    q = sample_starts(problem.task, 24, np.random.default_rng(0))
    mixed = basin_hopping._recombine(problem.task, q, np.random.default_rng(1))
    assert len(mixed) > 4
    for one in mixed:
        assert joint_distance(problem.task, one, q).min() > basin_hopping.HOPPING_OPTIONS.distance
    any_pairs = recombined_starts(problem.task, q, np.roll(q, 1, axis=0), np.random.default_rng(2))
    usual, chosen = (float(np.median(pk.torque_norm(problem.task.motion(x)))) for x in (any_pairs, mixed))
    assert chosen < usual


def test_where_no_pair_can_be_recombined_there_is_none(monkeypatch):
    problem = pk.Tracking(
        pk.arms.tringali_3r(), pk.line([0.4, 0.1], [0.1, 0.2], duration=1.0, samples=26), objectives=[pk.manipulability]
    )
    q = sample_starts(problem.task, 4, np.random.default_rng(0))
    monkeypatch.setattr(basin_hopping, "recombined_starts", lambda task, q, others, rng: q[:0])
    assert basin_hopping._recombine(problem.task, q, np.random.default_rng(1)).shape == (0, *q.shape[1:])


def test_an_optimum_that_cannot_be_disturbed_is_led_from_high_barriers_and_kept(monkeypatch):
    level = coarsest_level(tringali_2020.simulation_1().task)
    q = sample_starts(level, 1, np.random.default_rng(0))
    program = motion_program(level, objective_scales(level, q))
    ends = minimise(program, q, np.ones((1, 1)), options=LEVELS.cold[2])
    monkeypatch.setattr(basin_hopping, "perturbed_starts", lambda task, q, rng, size: q[:0])
    more = basin_hopping.disturb_best(program, ends, np.random.default_rng(0))
    assert joint_distance(level, ends.x[0], more.x).min() < 0.01


def test_disturbing_the_best_loses_no_optimum_and_leads_to_better_ones():
    problem = pk.Tracking(
        pk.Arm.planar(lengths=[0.4, 0.3, 0.3, 0.2], masses=[1.0] * 4, centers=[0.2, 0.15, 0.15, 0.1]),
        pk.line([1.0, 0.2], [-0.2, 0.5], duration=1.0, samples=26),
        objectives=[pk.torque_norm],
    )
    q = sample_starts(problem.task, 12, np.random.default_rng(0))
    program = motion_program(problem.task, objective_scales(problem.task, q))
    ends = minimise(program, q, np.ones((1, 1)), options=LEVELS.cold[2])
    order = np.argsort(np.where(ends.converged, ends.objectives[:, 0], -np.inf))
    few = ends[order[:-3:-1][::-1]]  # the worst two
    more = basin_hopping.disturb_best(program, few, np.random.default_rng(1))
    assert more.converged.all()
    assert (np.diff(more.objectives[:, 0]) >= 0).all()
    assert more.objectives[0, 0] < few.objectives[0, 0] * (1 - 1e-3)
    for one in few.x:
        assert joint_distance(problem.task, one, more.x).min() < 0.02

"""Restarts: more starts while they lead to better optima and better unseen ones are likely."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import CONVERGED, VIOLATED, Solutions
from paretoik.trajectory import plan_starts
from paretoik.trajectory.levels import OPTIONS as LEVELS
from paretoik.trajectory.levels import coarsest_level, objective_scales
from paretoik.trajectory.motion_terms import joint_distance
from paretoik.trajectory.plan import find_optima
from paretoik.trajectory.plan_starts import sample_starts
from paretoik.trajectory.transcription import motion_program
from problems import tringali_2020


def ends(q, values, converged=True):
    """Return solutions that are the starts themselves, with these values."""
    return Solutions(
        x=q,
        objectives=np.array(values, dtype=float)[:, None],
        bound_multipliers=np.full((len(q), 1), np.nan),
        stationarity=np.zeros(len(q)),
        violation=np.where(converged, 0.0, 1.0) * np.ones(len(q)),
        status=np.where(converged, CONVERGED, VIOLATED) * np.ones(len(q), dtype=int),
        iterations=np.ones(len(q), dtype=int),
    )


def policy_of(q, level):
    """Return the policy of a plan whose grid was tried."""
    policy = plan_starts.RestartPolicy(level, q, 24, np.random.default_rng(0))
    policy.grid_tried = True
    return policy


def starts_on(level, count):
    """Return starts of a level."""
    return sample_starts(level, count, np.random.default_rng(0))


def test_restarts_end_where_every_optimum_was_reached_again_and_go_on_where_each_was_reached_once():
    level = coarsest_level(tringali_2020.simulation_1().task)
    q = starts_on(level, 12)
    again = np.repeat(q[:3], 4, axis=0)
    more, _ = policy_of(again, level)(ends(again, np.repeat([1.0, 2.0, 3.0], 4)))
    assert len(more) == 0
    more, _ = policy_of(q, level)(ends(q, np.arange(1.0, len(q) + 1)))
    assert len(more) > 0


def test_starts_wait_while_a_better_optimum_is_likely_unseen_and_no_longer():
    level = coarsest_level(tringali_2020.simulation_1().task)
    portions = plan_starts.first_portions(starts_on(level, 48))
    assert [len(each) for each in portions] == [12] * 4
    policy = plan_starts.RestartPolicy(level, portions[0], 24, np.random.default_rng(0), portions[1:])
    policy.grid_tried = True
    few = ends(portions[0], np.arange(12.0) % 4)  # far apart: optima each
    more, barriers = policy(few)
    assert np.array_equal(more, portions[1])
    assert barriers == LEVELS.cold
    one = np.repeat(portions[0][:1], 24, axis=0)
    more, _ = policy(ends(one, np.ones(24)))
    assert len(more) == 0
    assert not policy.waiting


def test_starts_that_are_asked_for_are_all_minimised_and_by_default_as_many_as_it_takes():
    task, counts, values = tringali_2020.simulation_2().task.subsample(51), [], []
    for starts in (48, None):
        plan = find_optima(task, starts=starts, seed=1, observe=lambda level: counts.append(len(level.starts)))
        values.append(plan.best.objective)
    assert counts[0] >= 48 > counts[len(counts) // 2]
    assert values[1] == pytest.approx(values[0], rel=1e-9)


def test_starts_are_sampled_on_the_next_level_where_the_first_misleads_and_there_alone():
    task = tringali_2020.simulation_1().task
    level = coarsest_level(task)
    q, finer = starts_on(level, 12), motion_program(task, np.ones(1))
    coarse, fine = ends(q, np.arange(1.0, 13)), starts_on(task, 3)
    for best, misled in ((1.3, False), (1.35, True)):
        level_restarts = plan_starts.LevelRestarts([], 24, np.random.default_rng(0), "auto")
        assert level_restarts.further(motion_program(level, np.ones(1)), q, None) is not None
        further = level_restarts.further(finer, fine, coarse)
        more, barriers = further(ends(fine, [best, 2.0, 3.0]))
        assert bool(len(more)) == misled
        if misled:
            assert more.shape[1:] == fine.shape[1:]
            assert barriers == LEVELS.cold
        assert level_restarts.further(finer, fine, coarse) is None  # a third level


# Basin hopping: the best optima are perturbed and recombined


def test_perturbing_the_best_loses_no_optimum_and_leads_to_better_ones():
    problem = pk.Tracking(
        pk.Arm.planar(lengths=[0.4, 0.3, 0.3, 0.2], masses=[1.0] * 4, centers=[0.2, 0.15, 0.15, 0.1]),
        pk.line([1.0, 0.2], [-0.2, 0.5], duration=1.0, samples=14),
        objectives=[pk.torque_norm],
    )
    q = sample_starts(problem.task, 12, np.random.default_rng(0))
    program = motion_program(problem.task, objective_scales(problem.task, q))
    ends = minimise(program, q, np.ones((1, 1)), options=LEVELS.cold[2])
    order = np.argsort(np.where(ends.converged, ends.objectives[:, 0], -np.inf))
    few = ends[order[:-3:-1][::-1]]  # the worst two
    more = plan_starts.disturb_best(program, few, np.random.default_rng(1))
    assert more.converged.all()
    assert (np.diff(more.objectives[:, 0]) >= 0).all()
    assert more.objectives[0, 0] < few.objectives[0, 0] * (1 - 1e-3)
    for one in few.x:
        assert joint_distance(problem.task, one, more.x).min() < 0.02

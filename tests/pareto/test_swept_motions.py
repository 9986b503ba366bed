import numpy as np
import pytest

import paretoik as pk
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import InteriorPointOptions
from paretoik.pareto.sweep import Sweep
from paretoik.task.retraction import retract_nearest
from paretoik.trajectory.transcription import motion_program
from problems import tringali_2020
from studies.benchmarks.reference_front import reference_front


@pytest.fixture(scope="module")
def front():
    return pk.epsilon_front(tringali_2020.energy_torque(), points=12)


def test_the_front_reaches_both_of_ipopts_ends_and_is_not_beaten(front):
    reference = reference_front()
    assert front.minimised.min(axis=0) == pytest.approx(reference.min(axis=0), rel=1e-6)
    gain = (front.minimised[:, None] - reference[None]) / np.ptp(reference, axis=0)
    assert gain.max(axis=2).min() > -1e-2  # the reference is a front: no point is far below it
    assert np.all(gain.max(axis=2).min(axis=1) < 0.05)
    dominated = np.all(gain > 1e-6, axis=2).any(axis=1)
    assert not dominated.any()


@pytest.mark.parametrize("seed", [12, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (19, 21))])
def test_few_points_too_lie_on_the_best_branch_where_neither_end_does(seed):
    few, reference = pk.epsilon_front(tringali_2020.energy_torque(), points=5, seed=seed), reference_front()
    gain = (few.minimised[:, None] - reference[None]) / np.ptp(reference, axis=0)
    assert not np.all(gain > 1e-6, axis=2).any()


def test_every_point_is_a_certified_minimum_on_the_path(front):
    certificates = front.certificates
    assert len(front) >= 12
    assert certificates.criticality.max() <= 1e-6
    assert certificates.violation.max() <= 1e-8
    assert set(certificates.status) == {"minimum"}
    assert front.motions.tracking_error.max() <= 1e-9


def test_exchange_rates_are_the_slopes_of_neighbouring_solves(front):
    program = motion_program(tringali_2020.energy_torque().task)
    q, values = front.motions.q[4], front.objectives[4]
    step = 1e-4 * np.ptp(front.objectives[:, 1])
    caps = np.array([[np.inf, values[1] + step], [np.inf, values[1] - step]])
    factors = np.array([[1.0 / np.ptp(front.objectives[:, 0]), 0.0]])
    near = minimise(program, np.stack([q, q]), factors, caps, InteriorPointOptions(barrier=1e-4))
    assert near.converged.all()
    slope = np.diff(near.objectives[:, 1]) / np.diff(near.objectives[:, 0])
    assert front.certificates.exchange_rates[4, 0, 1] == pytest.approx(slope[0], rel=1e-3)
    assert front.certificates.exchange_rates[4, 1, 0] == pytest.approx(1 / slope[0], rel=1e-3)


def test_a_point_in_a_worse_valley_is_bettered_from_its_neighbours():
    problem = pk.Tracking(
        pk.arms.marcos_nr(4),
        pk.line([2.0, 0.0], [1.5, 1.0], duration=1.0, samples=16),
        objectives=[pk.joint_limit_distance, pk.manipulability],
        limits=pk.Limits(position=3.0),
        differences="backward",
    )
    front = pk.epsilon_front(problem, points=5, starts=8)
    ranges = np.ptp(front.minimised, axis=0)
    program, task = motion_program(problem.task, ranges), problem.task
    bump = 0.01 * np.sin(np.linspace(0, np.pi, 16))[:, None] * np.array([0.3, -1.0, 1.0, -0.4])
    motion = front.motions.q[2] + bump
    spoiled = retract_nearest(task.arm, task.tasks, motion, task.targets)
    assert spoiled.on_path.all()
    x = np.array(front.motions.q)
    x[2] = spoiled.q
    values = np.stack([o(task.motion(x)) * o.sign for o in task.objectives], axis=1) / ranges
    weights = np.full((5, 2), np.nan)
    sweep = Sweep(
        program=program,
        n_obj=2,
        x=x,
        objectives=values,
        weights=weights,
        points=5,
        solver="auto",
        observe=None,
        ranges=ranges,
    )
    worse = sweep.objectives[2].copy()
    others = np.delete(sweep.objectives, 2, axis=0)
    assert not np.any(np.all(others <= worse, axis=1))
    sweep.exchange_basins()
    gained = np.all(sweep.objectives <= worse + 1e-9, axis=1) & np.any(sweep.objectives < worse - 1e-4, axis=1)
    assert gained.any()

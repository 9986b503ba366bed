"""Point to point: closed-form times, the smooth program, and bounds that no motion can beat."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.capability.point_to_point_program import minimum_timing
from paretoik.errors import Infeasible, InvalidInput, OutOfReach
from paretoik.robot import dynamics, kinematics

START, TARGET = [0.1, -0.15], [0.2, -0.15]


@pytest.fixture(scope="module")
def problem():
    return pk.PointToPoint(
        pk.arms.kim_3r(), pk.capability.kim_joint_motors(), START, TARGET, samples=13, coefficients=5
    )


@pytest.fixture(scope="module")
def front(problem):
    return pk.solve(problem, population=32, generations=25, seed=1, points=6)


@pytest.fixture(scope="module")
def refined(front):
    return pk.refine(front)


def test_every_motion_goes_from_start_to_target_in_its_own_time(problem, front):
    motions = front.motions
    tool = kinematics.forward_kinematics(problem.arm, motions.q)[1][..., :2]
    assert tool[:, 0] == pytest.approx(np.tile(START, (len(front), 1)), abs=1e-9)
    assert tool[:, -1] == pytest.approx(np.tile(TARGET, (len(front), 1)), abs=1e-9)
    assert motions.time[:, -1] == pytest.approx(front.objectives[:, 0])
    assert np.ptp(motions.time[:, -1]) > 0


def test_in_every_interval_some_motor_is_at_its_limit_and_none_is_past_it(problem, front):
    q, times = front.motions.q, np.diff(front.motions.time, axis=1)
    middle = (q[:, 1:] + q[:, :-1]) / 2
    load = dynamics.inverse_dynamics(problem.arm, middle, 0 * middle, 0 * middle)
    room = problem.actuation.motors.slacks(load, np.diff(q, axis=1) / times[..., None])
    assert np.abs(room.min(axis=(-1, -2))).max() <= 1e-9


def test_neighbours_of_a_refined_front_are_on_one_branch(refined):
    assert refined.jumps == ()
    assert 0.0 < refined.missing_hypervolume < 0.5


def test_work_of_sliders_is_the_work_of_the_joints():
    problem = pk.PointToPoint(pk.arms.kim_3r(), pk.capability.kim_sliders(), START, TARGET, samples=49)
    genes = problem.sample_starts(2, np.random.default_rng(0))
    timing = problem.timing(genes)
    sliders = problem.sliders(genes)
    q = problem.decode(genes).q
    turned = (timing.effort * timing.travel).sum(axis=-2)
    middle = (q[:, 1:] + q[:, :-1]) / 2
    load = dynamics.inverse_dynamics(problem.arm, middle, 0 * middle, 0 * middle)
    assert turned == pytest.approx(load * np.diff(q, axis=1), abs=1e-4 * np.abs(turned).sum())
    assert np.diff(sliders, axis=1) == pytest.approx(timing.travel, abs=1e-12)


def test_no_motion_is_faster_than_directional_maxima_allow(problem, refined):
    """The highest speeds of all postures along the way bound the motion's time from below."""
    fine = problem.initial_paths.finer(8) @ problem.profiles(np.array(refined.genes[:1]))[0]
    tool = kinematics.forward_kinematics(problem.arm, fine[0])[1][:, :2]
    steps = np.diff(tool, axis=0)
    middle = (tool[1:] + tool[:-1]) / 2
    fastest = sum(
        np.linalg.norm(step) / pk.directional_maxima(problem.arm, problem.actuation, place, step[None]).values[0]
        for place, step in zip(middle, steps, strict=True)
    )
    assert refined.objectives[0, 0] >= fastest * (1 - 2e-3)


def test_between_samples_motors_are_nearly_as_fast_as_they_need_to_be(problem, refined):
    assert problem.violation_between(np.array(refined.genes)).max() < 0.5  # 13 samples are few
    q = problem.initial_paths.finer(8) @ problem.profiles(np.array(refined.genes))[0]
    fine = minimum_timing(problem.arm, problem.actuation, q, np.zeros_like(q))
    assert fine.duration == pytest.approx(refined.objectives[:, 0], rel=0.05)


@pytest.mark.usefixtures("unchecked")
def test_impossible_motions_are_refused_by_name():
    arm, motors = pk.arms.kim_3r(), pk.capability.kim_joint_motors()
    with pytest.raises(InvalidInput, match="target must differ from start"):
        pk.PointToPoint(arm, motors, START, START)
    with pytest.raises(InvalidInput, match="coefficients must be at most 5"):
        pk.PointToPoint(arm, motors, START, TARGET, samples=5, coefficients=6)
    with pytest.raises(OutOfReach, match="target: position out of reach"):
        pk.PointToPoint(arm, motors, START, [0.5, -0.15])
    with pytest.raises(Infeasible, match=r"joint\d must bear a torque of at most 3\.5 N m"):
        pk.PointToPoint(arm.with_payload(20.0), motors, START, TARGET)

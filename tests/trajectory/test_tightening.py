"""Limits that motions exceed between samples are tightened, and the new motions satisfy them."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.task.motion_task import finer_motion
from paretoik.trajectory.tightening import hold_between
from paretoik.trajectory.transcription import motion_program
from problems import tringali_2020

LIMITS = pk.Limits(velocity=3.0, acceleration=14.0)


def problem(*objectives, **settings):
    path = tringali_2020.straight(26)
    return pk.Tracking(pk.arms.tringali_3r(), path, objectives=list(objectives), limits=LIMITS, **settings)


def test_a_plan_keeps_its_limits_between_samples():
    best = pk.plan(problem(pk.kinetic_energy), starts=4).best
    assert best.violation_between == 0.0
    _, velocity, acceleration = best.motion.state(np.linspace(0, 1, 5001))
    for values, limit in ((velocity, 3.0), (acceleration, 14.0)):
        assert np.abs(values).max() <= limit * (1 + 1e-9)


def narrowly_exceeding():
    """Yield problems and motions that exceed a velocity limit only between the points of the usual finer grid."""
    best = pk.plan(problem(pk.kinetic_energy), starts=4).best.motion
    task = problem(pk.kinetic_energy).task
    coarse, fine = (np.abs(finer_motion(task.motion(best.q), *steps).dq) for steps in ((), (1600,)))
    for joint in range(3):
        limit = np.full(3, np.inf)
        limit[joint] = 0.5 * (coarse[:, joint].max() + fine[:, joint].max())
        if coarse[:, joint].max() < limit[joint] * (1 - 1e-8):
            limits = pk.Limits(velocity=limit)
            yield pk.Tracking(task.arm, tringali_2020.straight(26), objectives=[pk.kinetic_energy], limits=limits), best


def test_a_limit_exceeded_between_the_points_of_a_grid_is_seen_and_tightened():
    count = 0
    for narrow, motion in narrowly_exceeding():
        individuals = narrow.individuals(motion.q[None])
        assert individuals.violation_between[0] > 1e-9
        (words,) = narrow.exceeded(individuals)
        assert words.startswith("between samples: a limit is exceeded by up to")
        held = hold_between(narrow.program(np.ones(1)), motion.q, 1)
        assert held.violation <= 1e-9
        count += 1
    assert count > 0


@pytest.fixture(scope="module")
def front():
    return pk.epsilon_front(problem(pk.kinetic_energy, pk.torque_norm), points=3, starts=4)


def test_every_point_of_a_front_is_certified_for_limits_that_hold_between_samples(front):
    assert (front.certificates.status == "minimum").all()
    assert front.certificates.violation_between.max() <= 1e-9
    np.testing.assert_array_equal(front.violation_between, front.certificates.violation_between)


def test_refining_again_leaves_minima_as_they_are_or_betters_them(front):
    again = pk.refine(front, solver="interior-point")
    widths = np.ptp(front.ranges, axis=1)
    np.testing.assert_array_equal(again.ids, front.ids)
    assert (again.minimised <= front.minimised + 1e-9 * widths).all()
    assert (again.certificates.status == "minimum").all()
    assert again.certificates.criticality.max() <= 1e-6
    assert again.certificates.violation_between.max() <= 1e-9


def test_finite_differences_are_left_as_they_are_and_words_say_what_helps():
    central = problem(pk.kinetic_energy, differences="central")
    best = pk.plan(central, starts=4).best
    held = hold_between(motion_program(central.task), best.motion.q, 1)
    np.testing.assert_array_equal(held.x, best.motion.q)
    assert held.violation == best.violation_between > 1e-4
    words = central.task.describe_between(central.task.motion(best.motion.q[None]))
    assert words.startswith("between samples: acceleration of joint")
    assert 'differences="spline"' in words
    assert " s)" in words


def test_a_torque_limit_that_is_active_at_a_free_end_holds_between_samples():
    arm = pk.arms.tringali_3r()
    path = tringali_2020.straight(51)
    free = pk.plan(pk.Tracking(arm, path, objectives=[pk.torque_norm]), starts=6).best.motion
    limits = pk.Limits(torque=0.95 * np.abs(free.torque).max(axis=0))
    best = pk.plan(pk.Tracking(arm, path, objectives=[pk.torque_norm], limits=limits), starts=6).best
    slack = limits.torque - np.abs(finer_motion(best.motion).torque)
    assert slack[[0, -1]].min() <= 1e-2 * limits.torque.max()
    assert best.violation_between == 0.0

"""Motions between their samples: the interpolant is C² and on the path, or an error says that it is not."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik import Motion, Task, circle, line
from paretoik.errors import Infeasible, InvalidInput
from tests.task.test_differences import ARM, even


def on_circle(samples, cyclic=True, **settings):
    """Return a motion of the paper's arm with its tool on a circle and a prescribed direction of its last link."""
    path = circle([0.3, 0.0], 0.05, duration=1.0, samples=samples)
    turn = 0.3 * np.sin(2 * np.pi * path.times)
    wrist = path.positions - 0.1375 * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    reach = np.linalg.norm(wrist, axis=1)
    elbow = np.arccos((reach**2 - 2 * 0.176**2) / (2 * 0.176**2))
    shoulder = np.arctan2(wrist[:, 1], wrist[:, 0]) - elbow / 2
    q = np.stack([shoulder, elbow, turn - shoulder - elbow], axis=-1)
    q[-1] = q[0]
    task = Task(path).resolve_axes(ARM)
    return Motion(
        arm=ARM, time=path.times, q=q, tasks=(task,), cyclic=cyclic, **{"differences": "backward", **settings}
    )


@pytest.mark.parametrize("cyclic", [False, True])
def test_the_interpolant_returns_the_samples_at_their_times(cyclic):
    motion = on_circle(31, cyclic)
    assert motion.tracking_error.max() < 1e-12
    np.testing.assert_allclose(motion.at(motion.time), motion.q, atol=1e-11)
    free = Motion(arm=ARM, time=motion.time, q=motion.q, cyclic=cyclic, differences="backward")
    np.testing.assert_allclose(free.at(motion.time), motion.q, atol=1e-14)


@pytest.mark.parametrize("tasks", [True, False])
@pytest.mark.parametrize("cyclic", [False, True])
def test_the_interpolant_has_continuous_second_derivatives(tasks, cyclic):
    motion = on_circle(21, cyclic)
    motion = motion if tasks else Motion(arm=ARM, time=motion.time, q=motion.q, cyclic=cyclic, differences="backward")
    h = 1e-4
    around = np.arange(-2, 3) * h
    for knot in motion.time[3:-3]:
        left, right = (motion.at(knot + sign * h * 3 + around) for sign in (-1, 1))
        second = [np.diff(side, n=2, axis=0).mean(axis=0) / h**2 for side in (left, right)]
        third = np.abs(np.diff(motion.ddq, axis=0)).max() / (motion.time[1] - motion.time[0])
        assert np.abs(second[0] - second[1]).max() < 12 * h * third + 1e-3
    if cyclic:
        ends = [motion.at(np.array(t)) for t in ([0.0, h, 2 * h], [1 - 2 * h, 1 - h, 1.0])]
        slopes = [
            (-1.5 * ends[0][0] + 2 * ends[0][1] - 0.5 * ends[0][2]) / h,
            (1.5 * ends[1][2] - 2 * ends[1][1] + 0.5 * ends[1][0]) / h,
        ]
        np.testing.assert_allclose(slopes[0], slopes[1], atol=2e-4)


@pytest.mark.parametrize("t", [-1e-6, 1.0 + 1e-6, np.nan, np.inf])
def test_times_outside_the_motion_are_refused(t):
    motion = Motion(arm=ARM, time=even(5), q=np.zeros((5, 3)))
    with pytest.raises(InvalidInput, match=f"at: times t:? must be (from 0 s to 1 s|finite), got {t:g}"):
        motion.at(np.array([0.5, t]))


def test_a_motion_that_has_lost_its_path_is_not_led_somewhere_else():
    far = line([5.0, 0.0], [6.0, 0.0], duration=1.0, samples=5)
    motion = Motion(arm=ARM, time=far.times, q=np.full((5, 3), 0.3), tasks=(Task(far).resolve_axes(ARM),))
    with pytest.raises(Infeasible, match=r"at: the motion must follow its path, but at 0\.25 s its tool is"):
        motion.at(np.array([0.25]))

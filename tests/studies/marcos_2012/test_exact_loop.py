"""The exact step compared with grids and random steps, with and without obstacles."""

import numpy as np
import pytest

from paretoik.closed_loop.control_step import HISTORY
from paretoik.errors import Infeasible
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.robot.arms import marcos_nr
from paretoik.task.limits import Limits
from paretoik.task.path import line
from problems import marcos_2012
from studies.marcos_2012.exact_loop import exact_step, exact_steps
from tests.closed_loop.planar_geometry import meets
from tests.closed_loop.postures import posture


def first_step(links, *, blocked=False):
    return marcos_2012.loop(links, 0.7, start=posture(links), steps=25, as_printed=True, blocked=blocked)


def brute_force(loop, weight, *, fine=200001):
    """Return the best first step of three links, out of all steps on a line."""
    step = loop.step_state(1)
    error, jacobian = step.linearise()
    null = np.linalg.svd(jacobian)[2][2]
    y = np.sinh(np.linspace(-12, 12, fine)) / np.sinh(12) * 3.0
    q = step.previous + np.linalg.pinv(jacobian) @ error + y[:, None] * null
    F = np.stack(
        [
            ((q - step.previous) ** 2).sum(1) + ((q - step.home) ** 2).sum(1),
            np.hypot(
                np.cos(np.cumsum(q, axis=1)).sum(1) - step.target[0],
                np.sin(np.cumsum(q, axis=1)).sum(1) - step.target[1],
            ),
        ],
        axis=1,
    )
    ends = F[F.argmin(axis=0)]
    z = (F - ends.min(axis=0)) / np.ptp(ends, axis=0)
    return q[np.argmin(z @ [weight, 1 - weight])]


@pytest.mark.parametrize("weight", [0.1, 0.5, 0.9])
def test_the_exact_step_is_the_best_of_all(weight):
    loop = first_step(3)
    q = exact_steps(loop.task.truncate(3), loop.start, weight=weight)
    np.testing.assert_allclose(q[1], brute_force(loop, weight), atol=2e-7)


@pytest.mark.parametrize("blocked", [False, True])
def test_no_step_of_four_links_is_better_than_the_exact_one(blocked):
    loop = first_step(4, blocked=blocked)
    step = loop.step_state(1)
    error, jacobian = step.linearise()
    null = np.linalg.svd(jacobian)[2][2:].T
    rng = np.random.default_rng(0)
    radius, angle = 10 ** rng.uniform(-6, 0.9, size=300_000), rng.uniform(0, 2 * np.pi, size=300_000)
    y = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    q = step.previous + np.linalg.pinv(jacobian) @ error + y @ null.T
    if blocked:
        q = q[~meets(q, loop.task.obstacles)]

    def objectives(q):
        ends = np.cumsum(q, axis=-1)
        missed = np.stack([np.cos(ends).sum(-1), np.sin(ends).sum(-1)], -1) - step.target
        moved = np.sum((q - step.previous) ** 2 + (q - step.home) ** 2, axis=-1)
        return np.stack([moved, np.linalg.norm(missed, axis=-1)], axis=-1)

    exact = {
        weight: objectives(exact_steps(loop.task.truncate(3), loop.start, weight=weight)[1])
        for weight in (0.0, 0.2, 0.8, 1.0)
    }
    drawn = objectives(q)
    assert exact[1.0][0] <= drawn[:, 0].min() + 1e-9
    assert exact[0.0][1] <= drawn[:, 1].min() + 1e-9
    width = np.abs(exact[0.0] - exact[1.0])
    for weight in (0.2, 0.8):
        assert exact[weight] / width @ [weight, 1 - weight] <= (drawn / width @ [weight, 1 - weight]).min() + 1e-6


@pytest.mark.parametrize("links", [3, 4])
@pytest.mark.parametrize("longest", [np.inf, 0.1])
def test_exact_loops_keep_clear_of_obstacles_and_within_their_longest_step(links, longest):
    loop = first_step(links, blocked=True)
    q = exact_steps(loop.task.truncate(8), loop.start, weight=0.2, longest_step=longest)
    assert not meets(q, loop.task.obstacles).any()
    assert np.abs(np.diff(q, axis=0)).max() <= longest + 1e-9


def test_a_loop_takes_the_best_steps_one_by_one_and_names_a_missing_one():
    loop = marcos_2012.loop(3, 0.7, start=posture(3), steps=25, as_printed=False)
    q = exact_steps(loop.task.truncate(4), loop.start, weight=0.4, longest_step=loop.longest)
    history = np.tile(loop.start, (HISTORY, 1))
    for k in range(1, 4):
        np.testing.assert_allclose(exact_step(loop.step_state(k, history), weight=0.4), q[k], atol=1e-12)
        history = np.concatenate([history[1:], q[k][None]])
    with pytest.raises(Infeasible, match="step 1: there must be an admissible configuration, got none"):
        exact_steps(loop.task, loop.start, weight=0.4, longest_step=1e-3)


def test_joints_satisfy_their_limits():
    start = posture(3)
    limits = Limits(position=(start - 0.05, start + 0.4), velocity=3.0)
    loop = ClosedLoop(marcos_nr(3), marcos_2012.round_trip(0.7, 60), start=start, limits=limits, longest_step=np.inf)
    q = exact_steps(loop.task.truncate(6), start, weight=0.1)
    assert (q >= start - 0.05 - 1e-9).all()
    assert (q <= start + 0.4 + 1e-9).all()
    assert np.abs(np.diff(q, axis=0)).max() <= 3.0 * loop.task.times[1] + 1e-9


def test_a_stretched_arm_has_no_step():
    loop = ClosedLoop(marcos_nr(3), line([3.0, 0.0], [2.9, 0.0], duration=1.0, samples=3), start=np.zeros(3))
    with pytest.raises(Infeasible, match=r"step 1: .* or the arm is singular"):
        exact_steps(loop.task, loop.start, weight=0.5)


@pytest.mark.parametrize("weight", [0.3, 1.0])
def test_searched_loops_go_where_exact_ones_go(weight):
    loop = marcos_2012.loop(
        3, 0.7, weight=weight, start=posture(3), steps=25, population=120, generations=100, as_printed=True
    )
    run = loop.run(fronts=[1, 25])
    q = exact_steps(loop.task, loop.start, weight=weight)
    assert run.position_error == pytest.approx(loop.task.motion(q).position_error[1:].mean(), rel=0.01)
    assert np.abs(run.q - q).max() < 2e-3
    assert sorted(run.fronts) == [1, 25]
    assert run.drift == pytest.approx(np.linalg.norm(run.q[-1] - run.q[0]) / 3)

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from paretoik.closed_loop.admissible_steps import blocked, clearance_before
from paretoik.closed_loop.configurations import configurations
from paretoik.closed_loop.exact_step import hits
from paretoik.closed_loop.extended_jacobian import exact_steps, link_lengths, shapes
from paretoik.closed_loop.posture import first_posture
from paretoik.closed_loop.step import ControlStep
from paretoik.errors import Infeasible
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.robot.arms import marcos_nr
from paretoik.task.distances import signed_distance
from paretoik.task.obstacles import Circle
from problems import marcos_2012
from tests.closed_loop.postures import posture

STEPS = 25


def small(links, weight=0.5, **settings):
    given = {"start": posture(links), "steps": STEPS, "population": 60, "generations": 40, "as_printed": True}
    return marcos_2012.loop(links, 0.7, weight=weight, **{**given, **settings})


def brute_force(loop, weight, *, fine=200001):
    """Return the best first step of three links, of all on a line."""
    instant = loop.instant(1)
    wanted, jacobian = instant.asked()
    null = np.linalg.svd(jacobian)[2][2]
    y = np.sinh(np.linspace(-12, 12, fine)) / np.sinh(12) * 3.0
    q = instant.previous + np.linalg.pinv(jacobian) @ wanted + y[:, None] * null
    F = np.stack(
        [
            ((q - instant.previous) ** 2).sum(1) + ((q - instant.home) ** 2).sum(1),
            np.hypot(
                np.cos(np.cumsum(q, axis=1)).sum(1) - instant.target[0],
                np.sin(np.cumsum(q, axis=1)).sum(1) - instant.target[1],
            ),
        ],
        axis=1,
    )
    ends = F[F.argmin(axis=0)]
    z = (F - ends.min(axis=0)) / np.ptp(ends, axis=0)
    return q[np.argmin(z @ [weight, 1 - weight])]


@pytest.mark.parametrize("weight", [0.1, 0.5, 0.9])
def test_the_exact_step_is_the_best_of_all(weight):
    loop = small(3)
    q = exact_steps(loop.task.arm, loop.task.targets[:2], loop.start, weight=weight)
    np.testing.assert_allclose(q[1], brute_force(loop, weight), atol=2e-7)


@pytest.mark.parametrize("blocked", [False, True])
def test_no_step_of_four_links_is_better_than_the_exact_one(blocked):
    loop = small(4, blocked=blocked)
    instant, arm, obstacles = loop.instant(1), loop.task.arm, loop.task.obstacles
    wanted, jacobian = instant.asked()
    null = np.linalg.svd(jacobian)[2][2:].T
    rng = np.random.default_rng(0)
    radius, angle = 10 ** rng.uniform(-6, 0.9, size=300_000), rng.uniform(0, 2 * np.pi, size=300_000)
    y = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    q = instant.previous + np.linalg.pinv(jacobian) @ wanted + y @ null.T
    if blocked:
        lengths, (circles, boxes) = link_lengths(arm), shapes(obstacles)
        q = q[[not hits(lengths, each, circles, boxes) for each in q]]

    def objectives(q):
        ends = np.cumsum(q, axis=-1)
        missed = np.stack([np.cos(ends).sum(-1), np.sin(ends).sum(-1)], -1) - instant.target
        moved = np.sum((q - instant.previous) ** 2 + (q - instant.home) ** 2, axis=-1)
        return np.stack([moved, np.linalg.norm(missed, axis=-1)], axis=-1)

    exact = {
        weight: objectives(exact_steps(arm, loop.task.targets[:2], loop.start, weight=weight, obstacles=obstacles)[1])
        for weight in (0.0, 0.2, 0.8, 1.0)
    }
    drawn = objectives(q)
    assert exact[1.0][0] <= drawn[:, 0].min() + 1e-9
    assert exact[0.0][1] <= drawn[:, 1].min() + 1e-9
    width = np.abs(exact[0.0] - exact[1.0])
    for weight in (0.2, 0.8):
        assert exact[weight] / width @ [weight, 1 - weight] <= (drawn / width @ [weight, 1 - weight]).min() + 1e-6


@pytest.mark.parametrize("weight", [0.3, 1.0])
def test_searched_loops_go_where_exact_ones_go(weight):
    loop = small(3, weight, population=120, generations=100)
    run = loop.run(fronts=[1, STEPS])
    q = exact_steps(loop.task.arm, loop.task.targets, loop.start, weight=weight)
    assert run.position_error == pytest.approx(loop.task.motion(q).position_error[1:].mean(), rel=0.01)
    assert np.abs(run.q - q).max() < 2e-3
    assert sorted(run.fronts) == [1, STEPS]
    assert run.drift == pytest.approx(np.linalg.norm(run.q[-1] - run.q[0]) / 3)


def test_weights_alone_change_what_is_chosen():
    loop = small(4)
    near, far = loop.changed(weights=[1, 0]).run(), loop.changed(weights=[0, 1]).run()
    np.testing.assert_array_equal(near.q[0], far.q[0])
    assert near.drift < far.drift
    assert near.position_error > far.position_error


def test_states_are_the_same_again_and_tell_seeds_apart(monkeypatch):
    monkeypatch.setattr("paretoik.formulations.closed_loop.HASHED", 5)
    first, again, other = small(3).run(), small(3).run(), small(3, seed=1).run()
    assert len(first.digests) == STEPS // 5
    assert first.digests == again.digests
    assert first.digests != other.digests


@pytest.mark.parametrize("threads", [2, 4])
def test_states_are_the_same_whatever_runs_beside(monkeypatch, threads):
    monkeypatch.setattr("paretoik.formulations.closed_loop.HASHED", 5)
    loops = [small(links, weight) for links in (3, 4) for weight in (0.2, 0.8)]
    alone = [loop.run().digests for loop in loops]
    with ThreadPoolExecutor(threads) as pool:
        assert list(pool.map(lambda loop: loop.run().digests, loops)) == alone


def test_every_step_is_shown_as_it_is_taken():
    seen = []
    small(3).run(observe=lambda taken: seen.append((taken.sample, len(taken.front.F))))
    assert [sample for sample, _ in seen] == list(range(1, STEPS + 1))


def near_obstacle(population=60):
    """Return a loop whose arm must slide past a disc."""
    start = posture(3)
    joints = np.concatenate([[0.0], np.cumsum(np.exp(1j * np.cumsum(start)))])
    center = (joints[1] + joints[2]) / 2 + 0.11j * (joints[2] - joints[1])
    disc = Circle([center.real, center.imag], 0.1)
    return ClosedLoop(
        marcos_nr(3),
        marcos_2012.round_trip(0.7, STEPS),
        start=start,
        obstacles=[disc],
        population=population,
        generations=40,
        weights=[0.1, 0.9],
    )


@pytest.mark.parametrize("make", [lambda: small(3, blocked=True, as_printed=False), near_obstacle])
def test_all_of_every_step_is_clear_of_obstacles_by_other_geometry(make):
    loop = make()
    run = loop.run()
    lengths, (circles, boxes) = link_lengths(loop.task.arm), shapes(loop.task.obstacles)
    share = np.linspace(0, 1, 50)[:, None, None]
    between = (run.q[:-1] + share * np.diff(run.q, axis=0)).reshape(-1, 3)
    assert not any(hits(lengths, q, circles, boxes) for q in between)
    assert np.abs(np.diff(run.q, axis=0)).max() <= 0.1 * (1 + 1e-9)


def test_engine_and_problem_agree_on_what_is_free():
    count = 400
    loop = near_obstacle(population=count)
    instant, search = loop.instant(1), loop.search()
    step, (place, guard), room = ControlStep(instant, loop.objectives), search.situation(instant), search.room
    genes = step.shortened(np.random.default_rng(0).uniform(-1, 1, size=(count, step.n_var)))
    free = step.free(genes)
    assert 0.1 < free.mean() < 0.9
    room.children[:], room.asked[:] = genes.T, np.arange(count)
    clear = clearance_before(place, guard, room)
    configurations(room.children, 0, count, place, room.work, room.given)
    stopped = blocked(count, place, guard, clear, room)
    assert sorted(room.asked[:stopped]) == np.flatnonzero(~free).tolist()


@pytest.mark.parametrize("seed", range(3))
def test_the_oracles_geometry_is_that_of_obstacles(seed):
    rng = np.random.default_rng(seed)
    circle, box = marcos_2012.paper_obstacles(0.7)
    circles, boxes = shapes([circle, box])
    for q in rng.uniform(-np.pi, np.pi, size=(300, 3)):
        angles = np.cumsum(q)
        nodes = np.zeros((4, 3))
        nodes[1:, 0], nodes[1:, 1] = np.cumsum(np.cos(angles)), np.cumsum(np.sin(angles))
        gap = min(float(signed_distance(o, nodes[:-1], nodes[1:]).min()) for o in (circle, box))
        if abs(gap) > 1e-9:
            assert bool(hits(np.ones(3), q, circles, boxes)) == (gap < 0)


def test_an_obstacle_that_encloses_the_path_is_named_with_the_step():
    start = posture(3)
    wall = Circle((0.7 + 0.5 * np.cos(0.3), 0.5 * np.sin(0.3)), 0.05)
    loop = ClosedLoop(marcos_nr(3), marcos_2012.round_trip(0.7, 60), start=start, obstacles=[wall], population=8)
    loop.generations = 3
    with pytest.raises(Infeasible, match=r"step \d+ .*: a free configuration wanted.*from obstacle 1 of 1"):
        loop.run()


def test_a_start_is_found_near_the_path_and_clear_of_obstacles():
    task = small(4, blocked=True).task
    q = first_posture(task, population=200, generations=60, seed=3)
    assert np.linalg.norm(forward(q) - task.targets[0]) < 0.05
    lengths, (circles, boxes) = link_lengths(task.arm), shapes(task.obstacles)
    assert not hits(lengths, q, circles, boxes)


def forward(q):
    angles = np.cumsum(q)
    return np.array([np.cos(angles).sum(), np.sin(angles).sum()])


def test_short_steps_keep_the_standoff_too():
    loop = near_obstacle(population=200)
    instant, search = loop.instant(1), loop.search()
    (place, guard), room = search.situation(instant), search.room
    clear = clearance_before(place, guard, room)
    assert clear > guard.standoff > 0
    closer = guard._replace(standoff=0.999 * clear)
    q = instant.previous + np.random.default_rng(0).uniform(-1, 1, size=(200, 3)) * clear / guard.reach.sum() / 2
    room.given[:3], room.asked[:] = q.T, np.arange(200)
    stopped = blocked(200, place, closer, clear, room)
    wanted = np.flatnonzero(instant.gaps(q) <= closer.standoff).tolist()
    assert 0 < len(wanted) < 200
    assert sorted(room.asked[:stopped].tolist()) == wanted

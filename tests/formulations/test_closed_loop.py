"""Closed loops: their paths, repeatability, clearance and refusals."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.soo.nonconvex.cmaes import CMAES
from pymoo.optimize import minimize

import paretoik as pk
from paretoik.closed_loop.objectives import Step, step_objective
from paretoik.collision.obstacles import Circle
from paretoik.errors import Infeasible, InvalidInput
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.robot.arms import marcos_nr
from problems import marcos_2012
from tests.closed_loop.planar_geometry import meets
from tests.closed_loop.postures import near_obstacle, posture

STEPS = 25


def small(links, weight=0.5, **settings):
    defaults = {"start": posture(links), "steps": STEPS, "population": 60, "generations": 40, "as_printed": True}
    return marcos_2012.loop(links, 0.7, weight=weight, **{**defaults, **settings})


def test_weights_change_only_the_choice():
    loop = small(4)
    near, far = loop.changed(weights=[1, 0]).run(), loop.changed(weights=[0, 1]).run()
    np.testing.assert_array_equal(near.q[0], far.q[0])
    assert near.drift < far.drift
    assert near.position_error > far.position_error


def test_states_do_not_depend_on_other_threads():
    loops = [small(links, weight) for links in (3, 4) for weight in (0.2, 0.8)]
    alone = [loop.run().q for loop in loops]
    with ThreadPoolExecutor(4) as pool:
        for q, expected in zip(pool.map(lambda loop: loop.run().q, loops), alone, strict=True):
            np.testing.assert_array_equal(q, expected)


@pytest.mark.parametrize("make", [lambda: small(3, blocked=True, as_printed=False), near_obstacle])
def test_all_of_every_step_is_clear_of_obstacles_by_other_geometry(make):
    loop = make()
    run = loop.run()
    share = np.linspace(0, 1, 50)[:, None, None]
    between = (run.q[:-1] + share * np.diff(run.q, axis=0)).reshape(-1, 3)
    assert not meets(between, loop.task.obstacles).any()
    assert np.abs(np.diff(run.q, axis=0)).max() <= 0.1 * (1 + 1e-9)


def test_an_obstacle_that_encloses_the_path_is_named_with_the_step():
    start = posture(3)
    wall = Circle((0.7 + 0.5 * np.cos(0.3), 0.5 * np.sin(0.3)), 0.05)
    loop = ClosedLoop(marcos_nr(3), marcos_2012.round_trip(0.7, 60), start=start, obstacles=[wall], population=8)
    loop.generations = 3
    with pytest.raises(Infeasible, match=r"step \d+ .*: .* an admissible configuration.*from obstacle 1 of 1"):
        loop.run()


@step_objective(unit="rad")
def elbow(step: Step):
    return np.abs(step.motion.q[..., 1])


@pk.objective(unit="rad", form="general")
def whole(motion):
    return motion.q[..., 0, 0]


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"weights": [1.0, 2.0, 3.0]}, "weights"),
        ({"start": [4.0, 0.0, 0.0], "limits": pk.Limits(position=3.0)}, "start: .* must be from -3 to 3, got 4"),
        (
            {"obstacles": [pk.obstacles.Circle([1.2, 0.5], 1.0)]},
            "start must be clear of obstacles, got a posture .* m too near obstacle 1 of 1",
        ),
        ({"limits": pk.Limits(torque=3.0)}, "limits in a closed loop must be on position, .*, got torque"),
        ({"objectives": [elbow, whole]}, "objective whole must be of form integral or peak, .* whole motion"),
        ({"objectives": [elbow, abs]}, "objectives must be functions"),
    ],
)
def test_what_cannot_be_used_is_named(settings, said):
    path = marcos_2012.round_trip(0.7, 4)
    with pytest.raises(InvalidInput, match=said):
        ClosedLoop(pk.arms.marcos_nr(3), path, **{"start": posture(3), **settings})


def test_a_loop_is_not_one_search_and_the_error_names_what_is():
    loop = small(3)
    words = r"got a ClosedLoop; use pk.solve\(loop\), or loop.control_step\(k\), the pymoo problem of step k"
    for search in (
        lambda: pk.Search(loop),
        lambda: minimize(loop, NSGA2(), ("n_gen", 2)),
        lambda: minimize(loop, pk.MaxiMinNSGA2(), ("n_gen", 2)),
        lambda: minimize(loop, CMAES(), ("n_gen", 2)),
    ):
        with pytest.raises(InvalidInput, match=words):
            search()

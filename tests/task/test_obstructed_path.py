"""What is said of obstacles on the path before any search: which, where, and only where no motion can be feasible."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np
import pytest

import paretoik as pk
from paretoik.robot.kinematics import link_nodes
from paretoik.task.obstacles import clearance
from tests.api.problems import PATH

ARM = pk.arms.tringali_3r()
POINTS = PATH.positions
PANDA = Path(__file__).parents[2] / "problems" / "robots" / "panda.urdf"


def planar(obstacles, *, arm=ARM, path=PATH, **settings):
    return pk.Tracking(arm, path, objectives=[pk.kinetic_energy], obstacles=obstacles, **settings)


@pytest.mark.parametrize("sample", [0, 7, 20])
def test_the_obstacle_the_link_and_the_sample_are_named_before_any_search(sample):
    clear, blocked = pk.obstacles.Circle([1.0, 1.0], 0.1), pk.obstacles.Circle(POINTS[sample], 0.004)
    words = rf"obstacle 2, a circle, is in its way: at sample {sample} \(.*, the worst of \d+, the end of link 3"
    with pytest.warns(RuntimeWarning, match=words) as caught:
        planar([clear, blocked])
    assert "reaches 0.004 m into it" in str(caught[0].message)


@pytest.mark.parametrize("seed", range(40))
def test_it_is_said_where_every_motion_violates_the_clearance_and_only_there(seed):
    rng = np.random.default_rng(seed)
    middle = POINTS[int(rng.integers(len(POINTS)))] + rng.normal(size=2) * 0.03
    radius, link_radius, smallest = (float(rng.uniform(0.001, 0.03)) for _ in range(3))
    settings = {"link_radius": link_radius, "limits": pk.Limits(clearance=smallest)}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        problem = planar([pk.obstacles.Circle(middle, radius)], **settings)
    gap = float(np.linalg.norm(POINTS - middle, axis=1).min()) - radius - link_radius
    assert bool(caught) == (gap < smallest)
    motions = problem.decode(problem.sample_starts(6, rng))
    distances = clearance(problem.task.obstacles, link_nodes(ARM, motions.q), link_radius).min(axis=-1)
    assert (distances <= gap + 1e-9).all()  # what the warning rests on: no motion is clearer than its tool


def test_the_tool_is_where_with_tool_puts_it_and_not_at_the_flange():
    longer = ARM.with_tool(pk.Pose([0.0, 0.05, 0.0]))
    obstacle = pk.obstacles.Circle(POINTS[10], 0.002)
    with pytest.warns(RuntimeWarning, match="at sample 10 "):
        planar([obstacle], arm=longer)


def test_in_space_the_path_says_where_the_tool_is_unless_its_height_is_free():
    panda = pk.Arm.from_urdf(PANDA, base="panda_link0", tip="panda_hand_tcp")
    path = pk.line([0.45, -0.25, 0.3], [0.45, 0.25, 0.3], duration=1.5, samples=11)
    ball = pk.obstacles.Sphere([0.45, 0.0, 0.3], 0.02)
    with pytest.warns(RuntimeWarning, match=re.escape("a sphere, is in its way: at sample 5 (0.75 s)")):
        planar([ball], arm=panda, path=path)
    planar([ball], arm=panda, path=pk.Task(path, axes="xy"))
    planar([ball], arm=panda, path=pk.Task(path, frame="panda_joint7"))


def test_a_search_of_what_is_obstructed_still_ends_with_the_least_violating_motion():
    with pytest.warns(RuntimeWarning, match="no motion along it is feasible"):
        problem = planar([pk.obstacles.Circle(POINTS[10], 0.02)])
    with pytest.raises(pk.Infeasible) as refused:
        pk.plan(problem, starts=4, observe=False)
    assert refused.value.limit == "clearance"
    assert refused.value.motion is not None

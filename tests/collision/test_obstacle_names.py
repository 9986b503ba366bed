"""Names of obstacles: in messages, refused if equal, and without effect on a problem's fingerprint."""

from __future__ import annotations

import pickle
import re
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

import paretoik as pk
from paretoik.collision.obstacles import closest_pair, describe_obstacle, obstacle_name
from paretoik.errors import Infeasible, InvalidInput
from paretoik.runs.fingerprint import fingerprint
from paretoik.verification.measured_motion import nearest_pair
from problems import marcos_2012
from tests.closed_loop.postures import posture

Box, Capsule, Circle, Sphere = pk.obstacles.Box, pk.obstacles.Capsule, pk.obstacles.Circle, pk.obstacles.Sphere
MAKE = {
    "circle": lambda name: Circle([5.0, 5.0], 0.1, name=name),
    "sphere": lambda name: Sphere([5.0, 5.0, 0.0], 0.1, name=name),
    "capsule": lambda name: Capsule([5.0, 5.0, 0.0], [5.0, 6.0, 0.0], 0.1, name=name),
    "box": lambda name: Box([5.0, 5.0], [0.1, 0.1], name=name),
    "half-space": lambda name: pk.obstacles.HalfSpace([5.0, 5.0], [-1.0, 0.0], name=name),
}
every_shape = pytest.mark.parametrize("shape", MAKE)
SEGMENT = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])


def tracking(obstacles, **more):
    path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=11)
    return pk.Tracking(pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy], obstacles=obstacles, **more)


@every_shape
def test_a_name_is_in_the_words_for_an_obstacle_and_its_number_without_a_name(shape):
    other, named = MAKE["circle"](""), MAKE[shape]("table")
    assert (obstacle_name([other, named], 0), obstacle_name([other, named], 1)) == ("obstacle 1", "table")
    assert describe_obstacle([other, named], 1) == f"the obstacle table, a {shape}"
    assert describe_obstacle([other, MAKE[shape]("")], 1) == f"obstacle 2, a {shape}"
    assert "name='table'" in " ".join(repr(named).split())
    assert "name" not in repr(MAKE[shape](""))
    assert pickle.loads(pickle.dumps(named)).name == "table"


@every_shape
def test_both_searches_for_the_closest_pair_use_the_same_words(shape):
    for name in ("", "table"):
        obstacles = [Circle([1.9, 9.0], 0.1), MAKE[shape](name)]
        assert closest_pair(obstacles, SEGMENT) == nearest_pair(obstacles, SEGMENT)


@every_shape
@pytest.mark.parametrize(
    ("name", "message"),
    [
        (3, "name must be printable text, got 3"),
        ("two\nlines", "name must be printable text, got 'two\\nlines'"),
        (" table", "name must not begin or end with a space, got ' table'"),
    ],
)
def test_a_bad_name_is_refused_in_one_line(shape, name, message):
    with pytest.raises(InvalidInput, match=re.escape(f"{shape} {message}")):
        MAKE[shape](name)


@pytest.mark.parametrize("names", [("table", "table"), ("obstacle 2", "")])
def test_two_obstacles_of_one_name_are_refused(names):
    obstacles = [MAKE["sphere"](names[0]), MAKE["box"](names[1])]
    said = f"obstacles: names must differ, got 2 obstacles named {names[0]}"
    with pytest.raises(InvalidInput, match=re.escape(said)):
        tracking(obstacles)
    with pytest.raises(InvalidInput, match=re.escape(said)):
        pk.Motion(arm=pk.arms.tringali_3r(), time=[0.0, 1.0, 2.0], q=np.zeros((3, 3)), obstacles=tuple(obstacles))


def test_a_name_does_not_count_in_the_fingerprint_but_the_shape_does():
    plain = fingerprint(tracking([Circle([5.0, 5.0], 0.1)]))
    assert fingerprint(tracking([Circle([5.0, 5.0], 0.1, name="post")])) == plain
    assert fingerprint(tracking([Circle([5.0, 5.0], 0.2, name="post")])) != plain


def test_a_data_class_counts_without_the_fields_that_say_so():
    named, other = (SimpleNamespace(obstacle=Circle([0, 0], 1, name=name)) for name in ("a", "b"))
    assert fingerprint(named) == fingerprint(other)


def test_the_text_of_a_problem_has_the_names():
    text = repr(tracking([MAKE["circle"]("post"), MAKE["circle"](""), MAKE["box"]("table")]))
    assert "2 Circle (post), 1 Box (table)" in text


def test_an_obstacle_on_the_path_and_a_conflict_are_reported_by_name():
    with pytest.warns(RuntimeWarning, match="path: the obstacle post, a circle, is in its way"):
        blocked = tracking([Circle([0.283, 0.0763], 0.03, name="post")])
    with pytest.raises(Infeasible, match="between link 3 and the obstacle post, a circle"):
        pk.plan(blocked)


def test_an_obstacle_at_the_base_is_refused_by_name():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(InvalidInput, match="obstacles: the obstacle post, a circle, must be clear of the base"):
            tracking([Circle([0.0, 0.0], 0.03, name="post")])


def test_a_start_of_a_loop_in_an_obstacle_is_refused_by_name():
    disc = Circle([1.2, 0.5], 1.0, name="post")
    with pytest.raises(InvalidInput, match="too near the obstacle post, a circle"):
        pk.ClosedLoop(pk.arms.marcos_nr(3), marcos_2012.round_trip(0.7, 4), start=posture(3), obstacles=[disc])

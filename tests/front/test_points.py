"""Points and parts of a front by ids, bounds and preferences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from paretoik.errors import InvalidInput
from paretoik.front.front import Choice, Front
from paretoik.front.points import largest_id


def test_points_within_bounds_keep_all_that_they_have(front):
    part = front.where(energy=(2.0, 4.0), reach=(None, 9.0))
    assert part.ids.tolist() == [20, 30]
    assert (part.ranges == front.ranges).all()
    assert (part.motions.q == front.motions.q[1:3]).all()
    assert (part.genes == front.genes[1:3]).all()
    assert len(front.where({"energy": (7.0, None)})) == 0


def test_an_id_gives_its_point_and_ids_a_front(front):
    assert isinstance(front[30], Choice)
    assert (front[30].id, front[30].index) == (30, 2)
    assert front[[40, 10]].ids.tolist() == [10, 40]
    assert front[np.array([20])].ids.tolist() == [20]
    assert [point.id for point in front] == front.ids.tolist()


def test_a_front_says_which_ids_and_choices_it_has(front):
    assert all(number in front and np.int64(number) in front for number in front.ids.tolist())
    assert all(point in front for point in front)
    others = (0, 31, -1, 10**30, True, 10.0, "10", None, [10], front)
    assert not any(other in front for other in others)
    assert front[10] not in front[[20, 30]]
    assert front[10] not in replace(front, objectives=front.objectives * [2.0, 1.0])


def test_a_part_knows_the_largest_id_of_the_whole_in_its_run_too(front, tmp_path):
    assert largest_id(front) == largest_id(front[[10, 20]]) == largest_id(front[[10, 20]][[10]]) == 50
    assert front[[10, 50]].provenance == front.provenance
    front[[10, 20]].save(tmp_path / "part")
    assert largest_id(Front.load(tmp_path / "part")) == 50
    assert largest_id(front.where(energy=(7.0, None))) == 50


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda front: front[31], r"ids must be those of the front's points \(5 from 10 to 50\), got 31"),
        (lambda front: front["a"], "front index must be an id or a list of ids"),
        (
            lambda front: front.where(enrgy=(0, 1)),
            r"where must have names among energy, reach, got 'enrgy'; did you mean 'energy'\?",
        ),
        (lambda front: front.where(energy=(2, 1)), "must have lower <= upper"),
    ],
)
def test_what_is_no_part_of_the_front_is_refused_in_one_line(front, ask, words):
    with pytest.raises(InvalidInput, match=words):
        ask(front)


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda front: 1 / 0, "Own raised ZeroDivisionError"),
        (lambda front: front[[10, 20]].choice(1, "x") and front[[20, 30]].choice(0, "x"), "got point 20 of another"),
    ],
)
def test_a_preference_of_ones_own_is_checked(front, answer, words):
    class Own:
        def choose(self, front):
            return answer(front)

    with pytest.raises(InvalidInput, match=words):
        front.select(Own())

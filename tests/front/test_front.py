from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.errors import Infeasible, InvalidInput
from paretoik.front.front import Front
from paretoik.front.hypervolume import non_dominated
from paretoik.front.points import RESERVED_NAMES
from paretoik.front.preferences import Weights


def plain(objectives, **changes) -> Front:
    objectives = np.asarray(objectives, dtype=float)
    n_obj = objectives.shape[1] if objectives.ndim == 2 else 1
    fields = {
        "ids": np.arange(len(objectives)),
        "objectives": objectives,
        "names": [f"f{axis}" for axis in range(n_obj)],
        "units": [""] * n_obj,
        "maximised": [False] * n_obj,
    }
    return Front(**(fields | changes))


def test_points_are_sorted_by_the_first_objective_and_everything_moves_with_them(front):
    assert front.ids.tolist() == [10, 20, 30, 40, 50]
    assert front.objectives[:, 0].tolist() == [1, 2, 3, 4, 5]
    assert front.genes[:, 1].tolist() == [10, 20, 30, 40, 50]
    assert np.floor(front.motions.q[:, 0, 0]).tolist() == [1, 2, 3, 4, 5]
    assert (np.diff(front.violation) > 0).all()


def test_minimised_negates_what_is_maximised(front):
    assert (front.minimised == front.objectives * [1, -1]).all()
    assert non_dominated(front.minimised).all()


def test_shares_run_from_the_best_to_the_worst_of_the_stored_range(front):
    assert np.allclose(front.shares[:, 0], [0.1, 0.2, 0.3, 0.4, 0.5])
    assert np.allclose(front.shares[:, 1], 1 - np.array([1, 4, 9, 16, 25]) / 25)


@given(st.permutations(range(6)))
def test_the_order_in_which_points_are_given_does_not_matter(order):
    objectives = np.array([[1, 5, 0], [1, 4, 1], [1, 3, 2], [2, 2, 2], [2, 1, 3], [3, 0, 0]], dtype=float)
    shuffled = plain(objectives[list(order)], ids=np.arange(6)[list(order)])
    ordered = plain(objectives)
    assert (shuffled.ids == ordered.ids).all()
    assert (shuffled.objectives == ordered.objectives).all()


def test_an_empty_front_exists_and_says_so_when_chosen_from():
    front = plain(np.empty((0, 2)))
    assert len(front) == 0
    assert repr(front) == "Front of 0 points: f0, f1"
    with pytest.raises(Infeasible, match="no point was feasible"):
        front.select(Weights(f0=1.0))


def test_an_empty_part_of_a_front_is_not_taken_for_an_infeasible_problem(front):
    with pytest.raises(Infeasible, match="this part of the front has no point"):
        front.where(energy=(None, 0.0)).select("knee")


@pytest.mark.parametrize(
    ("objectives", "changes", "message"),
    [
        ([[1.0, 2.0], [2.0, 3.0]], {}, "got 1 dominated ones, the first with id 1"),
        ([[1.0, np.nan]], {}, "got inf or nan in 1 of 1 points"),
        ([[1.0, 2.0]], {"ids": np.array([0.5])}, "front ids: must contain integers, got float64"),
        ([[1.0, 2.0], [2.0, 1.0]], {"ids": np.array([4, 4])}, "got 4 more than once"),
        ([[1.0, 2.0]], {"genes": np.array([[np.nan]])}, "genes must be finite"),
        ([[1.0, 2.0]], {"ranges": np.array([[0.0, 1.0], [2.0, np.inf]])}, "ranges must"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_what_is_no_front_is_refused(objectives, changes, message):
    with pytest.raises(InvalidInput, match=message):
        plain(objectives, **changes)


@pytest.mark.parametrize("name", ["", "=1+1", "a ", "a\x00", RESERVED_NAMES[0]])
def test_a_name_that_no_table_can_hold_is_refused(name):
    with pytest.raises(InvalidInput, match="front names must"):
        plain([[1.0, 2.0]], names=["fine", name])


def test_motions_must_be_one_per_point(front):
    with pytest.raises(InvalidInput, match="motions must be a batch of 1"):
        plain([[1.0, 2.0]], motions=front.motions)

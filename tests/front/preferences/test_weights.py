from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.errors import InvalidInput
from paretoik.front.front import Front
from paretoik.front.preferences import Bounds, Classify, Weights

LINE = np.linspace(0.1, 1.0, 7)
few = settings(max_examples=30)


def curve(**changes) -> Front:
    settings = {
        "ids": np.arange(7) + 100,
        "objectives": np.stack([LINE, 1 / LINE], axis=1),
        "names": ["energy", "torque"],
        "units": ["J s", "N²m²s"],
        "maximised": [False, False],
    }
    return Front(**(settings | changes))


@few
@given(st.floats(0, 1e308), st.floats(0, 1e308))
def test_the_least_weighted_sum_of_shares_wins(energy, torque):
    if energy == torque == 0:
        return
    front = curve()
    z = (front.objectives - front.objectives.min(0)) / np.ptp(front.objectives, axis=0)
    w = np.array([energy, torque]) / max(energy, torque)
    g = z @ (w / w.sum())
    choice = front.select(Weights(energy=energy, torque=torque))
    assert g[choice.index] <= g.min() + 1e-12
    assert choice.id == front.ids[choice.index]
    assert (choice.objectives == front.objectives[choice.index]).all()


@few
@given(st.floats(0.01, 100), st.floats(0.01, 100), st.floats(-1e3, 1e3), st.floats(0.01, 1.0))
def test_neither_units_nor_the_sum_of_the_weights_matter(scale, factor, offset, weight):
    front = curve()
    other = curve(objectives=front.objectives * [scale, 1.0] + [0.0, offset])
    weights = {"energy": weight, "torque": 1.0}
    chosen = front.shares @ [weight, 1.0]
    if np.diff(np.sort(chosen)[:2]) < 1e-9:
        return
    assert front.select(Weights(weights)).id == other.select(Weights({k: factor * w for k, w in weights.items()})).id


def test_shares_are_taken_of_the_stored_range_and_not_of_the_front():
    near = curve(ranges=np.array([[0.0, 1.0], [0.0, 10.0]]))
    far = curve(ranges=np.array([[0.0, 1.0], [0.0, 1e6]]))
    assert far.select(Weights(energy=0.5, torque=0.5)).id == 100
    assert near.select(Weights(energy=0.5, torque=0.5)).id > 100


def test_ties_go_to_the_lowest_sum_then_the_best_first_objective_then_the_lowest_id():
    sums = np.array([[0.0, 0.6, 1.0], [0.0, 0.9, 0.5], [1.0, 0.0, 0.0]])
    more = {"names": ["a", "b", "c"], "units": [""] * 3, "maximised": [False] * 3}
    assert curve(ids=np.array([1, 2, 3]), objectives=sums, **more).select(Weights(a=1.0)).id == 2
    front = curve(ids=np.array([9, 5, 7]), objectives=np.array([[0.0, 1.0], [0.5, 0.5], [1.0, 0.0]]))
    assert front.select(Weights(energy=1.0, torque=1.0)).id == 9
    front = curve(ids=np.array([9, 5, 7]), objectives=np.array([[0.0, 1.0], [0.0, 1.0], [1.0, 0.0]]))
    assert front.select(Weights(energy=1.0, torque=1.0)).id == 5


def test_the_verdict_says_what_was_weighed_and_which_points_no_weights_reach():
    front = curve(ids=np.array([1, 2, 3]), objectives=np.array([[1.0, 4.0], [2.0, 1.0], [5.0, 0.0]]))
    assert front.select(Weights(energy=3.0, torque=3.0)).verdict == (
        "Point 2 of 3 has the least weighted sum, 0.25, of the objectives as shares of their ranges "
        "(energy 50%, torque 50%)."
    )
    hollow = curve(ids=np.array([1, 2, 3]), objectives=np.array([[1.0, 4.0], [4.0, 3.0], [5.0, 0.0]]))
    assert hollow.select(Weights(energy=1.0)).verdict == (
        "Point 1 of 3 has the least weighted sum, 0, of the objectives as shares of their ranges (energy 100%). "
        "Without a weight, torque decided only between equal sums. No weights reach 1 of the points, which are "
        "above straight lines between others, among them its neighbour 2; an aspiration can reach them."
    )


def test_the_numbers_of_a_verdict_are_fields_of_the_choice():
    choice = curve(objectives=np.stack([LINE, np.sqrt(1.3 - LINE**2)], axis=1)).select(Weights(energy=3.0, torque=1.0))
    assert choice.details == {"weights": {"energy": 0.75, "torque": 0.25}, "unreached": (101, 102, 103, 104, 105)}
    assert choice.score == pytest.approx(choice.shares @ [0.75, 0.25])
    assert repr(choice.preference) == "Weights(energy=3, torque=1)"


@pytest.mark.parametrize("weight", [-1.0, float("nan"), "1"])
@pytest.mark.usefixtures("unchecked")
def test_a_weight_that_is_no_number_from_zero_up_is_refused(weight):
    with pytest.raises(InvalidInput, match="energy must be a finite number >= 0"):
        Weights(energy=weight)


@pytest.mark.parametrize(
    "preference",
    [
        Weights(enrgy=1.0),
        Bounds(energy=(None, 100.0), then=Weights(enrgy=1.0)),
        Classify(100, improve=["enrgy"], free=["torque"]),
    ],
    ids=repr,
)
def test_an_unknown_name_is_refused_with_the_valid_ones_and_the_likely_one(preference):
    with pytest.raises(InvalidInput, match=r"names among energy, torque, got 'enrgy'; did you mean 'energy'\?"):
        curve().select(preference)

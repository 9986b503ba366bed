from __future__ import annotations

import numpy as np
import pytest

from paretoik.errors import InvalidInput
from paretoik.front.front import Front
from paretoik.front.preferences import Bounds, Classify, Weights

LINE = np.linspace(0.1, 1.0, 7)


def curve(**changes) -> Front:
    settings = {
        "ids": np.arange(7) + 100,
        "objectives": np.stack([LINE, 1 / LINE], axis=1),
        "names": ["energy", "torque"],
        "units": ["J s", "N²m²s"],
        "maximised": [False, False],
    }
    return Front(**(settings | changes))


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

"""Numbers and arrays that users give: what passes is a copy, what does not is named."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.errors import InvalidInput
from paretoik.inputs import degrees_hint, finite_array, likely_spelling, positive_number
from paretoik.robot.pose import Pose


def test_an_array_is_copied_as_floats():
    values = np.array([1, 2, 3])
    array = finite_array("x", values, shape=(3,))
    assert array.dtype == float
    assert not np.shares_memory(array, values)
    assert np.array_equal(array, values)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("value", "shape", "message"),
    [
        ([[1.0], [1.0, 2.0]], None, "x: must be an array of numbers, got rows of different lengths"),
        (["a"], None, "x: must hold real numbers, got text"),
        ([1 + 2j], None, "x: must hold real numbers, got complex128"),
        (None, None, "x: must hold real numbers, got object"),
        ([True], None, "x: must hold real numbers, got bool"),
        ([1.0, 2.0], (3,), r"x: must have shape \(3,\), got shape \(2,\)"),
        ([0.0, np.nan], None, "x: must be finite, got nan at index 1"),
        ([[0.0], [np.inf]], None, r"x: must be finite, got inf at index \(1, 0\)"),
        (np.inf, (), "x: must be finite, got inf$"),
    ],
)
def test_what_is_no_array_of_finite_numbers_is_refused(value, shape, message):
    with pytest.raises(InvalidInput, match=message):
        finite_array("x", value, shape)


@pytest.mark.parametrize("value", [0, -1.5])
def test_a_number_that_is_not_positive_is_refused_with_its_unit(value):
    with pytest.raises(InvalidInput, match=f"radius: must be positive, got {value:g} m"):
        positive_number("radius", value, "m")
    assert positive_number("radius", 2, "m") == 2.0


def test_angles_of_more_than_two_turns_are_taken_for_degrees():
    assert degrees_hint([2 * np.pi, -4 * np.pi, np.inf]) == ""
    assert degrees_hint([0.1, -90.0]).startswith("90 rad is 14.3 turns; of degrees, np.deg2rad")
    with pytest.warns(RuntimeWarning, match=r"pose rpy: 180 rad is 28.6 turns"):
        Pose.from_rpy([0.0, 0.0, 0.0], [180.0, 0.0, 0.0])


def test_a_name_spelt_much_like_another_is_asked_after():
    assert likely_spelling("left_griper", ["left_gripper", "base"]) == "; did you mean 'left_gripper'?"
    assert likely_spelling("quite_another", ["left_gripper", "base"]) == ""

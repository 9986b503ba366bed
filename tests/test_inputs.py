"""Numbers and arrays of users: accepted ones are copied, others are refused by name."""

from __future__ import annotations

import itertools
import signal
import threading
import warnings
from functools import partial

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import EvaluationFailed, InvalidInput
from paretoik.inputs import (
    degrees_hint,
    finite_array,
    user_function,
    warn_of_odd_objectives,
)
from paretoik.robot.pose import Pose
from paretoik.stop_flag import Interrupted


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
        (["a"], None, "x: must contain real numbers, got text"),
        ([True], None, "x: must contain real numbers, got bool"),
        ([1.0, 2.0], (3,), r"x: must have shape \(3,\), got shape \(2,\)"),
        ([[0.0], [np.inf]], None, r"x: must be finite, got inf at index \(1, 0\)"),
        (np.inf, (), "x: must be finite, got inf$"),
    ],
)
def test_what_is_no_array_of_finite_numbers_is_refused(value, shape, message):
    with pytest.raises(InvalidInput, match=message):
        finite_array("x", value, shape)


def test_angles_of_more_than_two_turns_are_taken_for_degrees():
    assert degrees_hint([2 * np.pi, -4 * np.pi, np.inf]) == ""
    assert degrees_hint([0.1, -90.0]).startswith("90 rad is 14.3 turns; if it is in degrees, convert it by np.deg2rad")
    with pytest.warns(RuntimeWarning, match=r"pose rpy: 180 rad is 28.6 turns"):
        Pose.from_rpy([0.0, 0.0, 0.0], [180.0, 0.0, 0.0])


# An error of a user's function becomes one line, except Ctrl-C and our own errors.


class SpeechlessError(Exception):
    def __str__(self):
        raise RuntimeError("no text")


class Foreign(BaseException):
    pass


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ValueError("over\n  0.3"), "ValueError: over 0.3"),
        (SpeechlessError(), "SpeechlessError"),
        (SystemExit(0), "SystemExit: 0"),
        (Foreign("elsewhere"), "Foreign: elsewhere"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_is_raised_is_a_failure_with_its_name_and_cause(error, words):
    with pytest.raises(EvaluationFailed) as failure, user_function("objective mine"):
        raise error
    assert str(failure.value) == f"objective mine raised {words}"
    assert failure.value.__cause__ is error


@pytest.mark.parametrize("error", [Interrupted(), InvalidInput("shape must be (3,), got (4,)")])
def test_our_own_errors_pass(error):
    with pytest.raises(type(error)) as failure, user_function("objective mine"):
        raise error
    assert failure.value is error


def test_control_c_passes():
    with pytest.raises(KeyboardInterrupt), user_function("objective mine"):
        signal.raise_signal(signal.SIGINT)
    timer = threading.Timer(0.1, signal.pthread_kill, [threading.main_thread().ident, signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt), user_function("objective mine"):
        sum(1 for _ in itertools.count())


def test_another_kind_of_failure_can_be_asked_for():
    with (
        pytest.raises(InvalidInput, match="select: Mine raised KeyError: 'wrist'"),
        user_function("select: Mine", InvalidInput),
    ):
        raise KeyError("wrist")


@pytest.mark.parametrize("again", [1.0, 1.0 + 1e-9])
def test_an_objective_with_the_values_of_another_is_said_to_be_a_duplicate_of_the_first(again):
    F = np.random.default_rng(0).normal(size=(8, 3))
    F[:, 2] = F[:, 0] * again
    F[3] = np.nan  # failed
    words = "^objective c must differ from a, got the same values for each of the first 7"
    with pytest.warns(RuntimeWarning, match=words) as told:
        warn_of_odd_objectives(["a", "b", "c"], F, F)
    assert len(told) == 1


def test_objectives_that_differ_at_one_argument_are_no_duplicates():
    F = np.repeat(np.random.default_rng(0).normal(size=(8, 1)), 2, axis=1)
    F[5, 1] += 1e-3
    with warnings.catch_warnings(action="error"):
        warn_of_odd_objectives(["a", "b"], F, F)
        warn_of_odd_objectives(["a", "b"], F[:1], F[:1])  # one argument says nothing


class Reach:
    def __call__(self, motion):
        return motion.q


def reach(motion, scale):
    return motion.q * scale


@pytest.mark.parametrize(
    ("function", "name"), [(reach, "reach"), (partial(partial(reach), scale=2.0), "reach"), (Reach(), "Reach")]
)
def test_functions_are_called_by_their_name_and_callables_by_what_they_are(function, name):
    assert pk.objective(unit="", form="integral")(function).name == name
    assert pk.constraint(unit="", upper=1.0)(function).name == name
    assert pk.step_objective(unit="")(function).name == name


def test_a_lambda_as_a_constraint_is_called_by_its_bounds():
    assert pk.constraint(unit="m", lower=-0.5, upper=1.0)(lambda motion: motion.q).name == "lambda in [-0.5, 1] m"

"""Endings of a search and their reasons."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.errors import InvalidInput
from paretoik.search.archive import Failures
from paretoik.search.endings import Evaluations, Generations, Progress, Stagnation, Target, TimeLimit

LINE = np.column_stack((np.linspace(0, 1, 11), np.linspace(1, 0, 11)))


def progress(front=LINE, *, past=(), generation=5, evaluations=100, seconds=3.0):
    return Progress(
        generation=generation,
        evaluations=evaluations,
        seconds=seconds,
        failed=Failures(),
        population=np.asarray(front),
        front=np.asarray(front),
        ids=np.arange(len(front)),
        past=tuple(past),
    )


@pytest.mark.parametrize(
    ("ending", "early", "reason"),
    [
        (Generations(5), {"generation": 4}, "generations"),
        (Evaluations(100), {"evaluations": 99}, "evaluations"),
        (TimeLimit(3.0), {"seconds": 2.9}, "time limit"),
    ],
)
def test_limits_end_when_they_are_reached_and_not_before(ending, early, reason):
    assert ending.reached(progress()) == reason
    assert ending.reached(progress(**early)) is None


@pytest.mark.parametrize(
    ("ending", "arguments", "message"),
    [
        (Generations, (0,), "generations must be an integer of at least 1, got 0"),
        (TimeLimit, (0.0,), "time limit must be more than 0 seconds, got 0.0"),
        (Target, ((1.0, float("nan")),), "target.*nan"),
    ],
)
def test_limits_that_cannot_be_used_are_refused_by_name_and_value(ending, arguments, message):
    with pytest.raises(InvalidInput, match=message):
        ending(*arguments)


def test_nothing_moving_for_long_enough_is_stagnation():
    ending = Stagnation(over=3)
    assert ending.reached(progress(past=[LINE] * 3)) == "stagnation"
    assert ending.reached(progress(past=[LINE] * 2)) is None


@pytest.mark.parametrize(
    "then",
    [
        LINE * 1.001,  # the hypervolume grew
        LINE[1:],  # the ideal moved
        np.concatenate((LINE, [[-0.1, 1.5]])),  # the nadir moved
        np.empty((0, 2)),  # nothing was feasible yet
    ],
)
def test_a_front_that_grew_or_whose_ends_moved_is_no_stagnation(then):
    assert Stagnation(over=1).reached(progress(past=[then])) is None


def test_a_target_is_met_by_one_point_as_good_in_every_objective():
    assert Target((0.5, 0.5)).reached(progress()) == "target"
    assert Target((0.5, 0.45)).reached(progress()) is None
    assert Target((np.inf, 0.0)).reached(progress()) == "target"
    with pytest.raises(InvalidInput, match=r"target must have one number per objective \(2\), got 1"):
        Target((0.5,)).reached(progress())


def test_hypervolume_is_normalised_by_the_front_itself():
    assert progress().hypervolume == pytest.approx(progress(LINE * [3.0, 1e6] + [5.0, -7.0]).hypervolume)
    assert progress([[2.0, 3.0]]).hypervolume == pytest.approx(1.1**2)
    assert progress(np.empty((0, 2))).hypervolume == 0.0

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.api.certified_front import LaterTime
from paretoik.runs.interruption import OPTIONS, time_left
from tests.api.problems import tracking


@pytest.mark.parametrize(("done", "seconds"), [(0, 10.0), (1, 10.0), (10, 0.5 * OPTIONS.seconds)])
def test_nothing_is_said_before_enough_is_done(done: int, seconds: float):
    assert time_left(done, 20 - done, seconds) is None


def test_a_stage_goes_on_as_fast_as_it_was_and_later_ones_are_added():
    assert time_left(10, 10, 20.0) == 20.0
    assert time_left(10, 5, 20.0, later=7.0) == 17.0


def test_later_stages_are_measured_on_points_as_they_come(monkeypatch, unchecked):
    """Two of four points exceed limits: looks at all of them, tightening of half, certificates of all are counted."""
    clock, problem = [0.0], tracking()
    monkeypatch.setattr("paretoik.api.certified_front.computing_clock", lambda: clock[0])

    class Individuals:
        def __init__(self, x):
            clock[0] += 0.01
            self.violation_between = np.where(x[:, 0, 0] > 0, 1e-3, 0.0)

    class Formulation:
        def individuals(self, x):
            return Individuals(x)

        def hold_between(self, x, ranges, solver):
            clock[0] += 3.0
            return x, [problem.program(ranges)]

    def certify(programs, x, **settings):
        clock[0] += 0.2

    monkeypatch.setattr("paretoik.api.certified_front.certify", certify)
    later = LaterTime(formulation=Formulation())
    for sign in (1.0, -1.0, 2.0, -2.0, -2.0):  # the last one has been seen
        later.try_point(np.full((21, 3), sign), np.ones(2), seconds=1e6)
    assert later.per_point() == pytest.approx(0.01 + 3.0 / 2 + 0.21)
    spent = later.spent
    later.try_point(np.full((21, 3), 3.0), np.ones(2), seconds=0.1)
    assert later.spent == spent  # too early


def test_trials_of_later_stages_change_no_result():
    """They are made for an observer only."""
    fronts = [
        pk.epsilon_front(tracking(), points=6, starts=4, observe=observe) for observe in (False, lambda progress: None)
    ]
    assert np.array_equal(fronts[0].objectives, fronts[1].objectives)

"""The filter of the line search beside its conditions: Armijo's where nothing is violated, else a gain in either."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from paretoik.nlp.banded.interior_point import _filter_accepts
from paretoik.nlp.program import InteriorPointOptions

OPTIONS = InteriorPointOptions()


def accepts(theta, before, trial_theta, after, slope, length=1.0, infeasible=1e-4, entries=()):
    table = np.zeros((10, 2))
    table[: len(entries)] = np.reshape(entries, (-1, 2))
    accepted, count = _filter_accepts(
        theta, before, trial_theta, after, slope, length, infeasible, table, len(entries), OPTIONS
    )
    return accepted, table[:count].tolist()


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-5, -1e-3), st.floats(1e-3, 1))
def test_without_residuals_a_step_is_taken_by_armijos_condition(before, after, slope, length):
    allowed = after <= before + OPTIONS.armijo * length * slope + OPTIONS.merit_rounding * abs(before)
    assert accepts(0.0, before, 0.0, after, slope, length) == (allowed, [])


@given(st.floats(0.1, 2), st.floats(-3, 3), st.floats(0, 3), st.floats(-3, 3))
def test_with_residuals_a_step_has_to_gain_in_residuals_or_merit_and_enters_the_filter(theta, before, trial, after):
    margin = OPTIONS.filter_margin
    rounding = OPTIONS.merit_rounding * abs(before)
    gains = trial <= (1 - margin) * theta or after <= before - margin * theta + rounding
    assert accepts(theta, before, trial, after, slope=1.0) == (gains, [[theta, before]] if gains else [])


def test_a_step_that_an_entry_of_the_filter_dominates_is_refused():
    assert accepts(1.0, 0.0, 0.5, -1.0, 1.0, entries=[[0.2, -2.0]]) == (False, [[0.2, -2.0]])
    assert accepts(1.0, 0.0, 0.1, -1.0, 1.0, entries=[[0.2, -2.0]])[0]
    assert accepts(1.0, 0.0, 0.5, -3.0, 1.0, entries=[[0.2, -2.0]])[0]


def test_what_is_not_finite_is_refused():
    for trial_theta, after in ((np.inf, 0.0), (0.0, np.nan)):
        assert accepts(1.0, 0.0, trial_theta, after, -1.0) == (False, [])

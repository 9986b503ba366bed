"""Golden sections and bisection, written into compiled callers."""

import numpy as np
import pytest

from paretoik.capability.actuator_kernels import bisect, golden_section
from paretoik.compilation.numba_cache import compiled, inlined


@inlined
def _parabola(x, arguments):
    center, calls = arguments
    calls[0] += 1
    return (x - center) ** 2 - 1.0


@inlined
def _blocked(x, arguments):
    center, _ = arguments
    return x if abs(x - center) < 0.2 else np.inf


@compiled
def least(center, low, high, calls):
    return golden_section(_parabola, (center, calls), low, high, 60)


@compiled
def first_below(center, low, high, target, calls):
    return golden_section(_parabola, (center, calls), low, high, 60, np.inf, target)


@compiled
def least_free(center, low, high, tie, calls):
    return golden_section(_blocked, (center, calls), low, high, 60, tie)


@compiled
def last_above(center, inside, outside, calls):
    return bisect(_parabola, (center, calls), inside, outside, 60)


@pytest.mark.parametrize("center", [-0.3, 0.0, 1.7])
def test_the_least_is_found_with_one_call_an_iteration(center):
    calls = np.zeros(1)
    value, place = least(center, -1.0, 2.0, calls)
    assert value == pytest.approx(-1.0)
    assert place == pytest.approx(center, abs=1e-7)
    assert calls[0] == 62


@pytest.mark.parametrize("center", [-5.0, 5.0])
def test_where_there_is_none_inside_the_nearer_end_is_the_least(center):
    place = least(center, -1.0, 2.0, np.zeros(1))[1]
    assert place == pytest.approx(np.clip(center, -1.0, 2.0), abs=1e-9)


def test_the_search_ends_at_the_target():
    calls = np.zeros(1)
    value, _ = first_below(0.4, -1.0, 2.0, -0.9, calls)
    assert -1.0 < value <= -0.9
    assert calls[0] < 20


def test_ties_lead_to_where_they_are_told():
    assert least_free(0.5, -4.0, 5.0, 0.5, np.zeros(1))[0] == pytest.approx(0.3, abs=1e-6)
    assert least_free(0.5, -4.0, 5.0, np.inf, np.zeros(1))[0] == np.inf


def test_bisection_ends_at_the_root_on_the_side_that_it_came_from():
    for inside, root in ((5.0, 1.0), (-5.0, -1.0)):
        place = last_above(0.0, inside, 0.0, np.zeros(1))
        assert place == pytest.approx(root, abs=1e-12)
        assert place**2 >= 1.0

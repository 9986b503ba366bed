from __future__ import annotations

import pytest

from paretoik.api.time_left import OPTIONS, sweep_time_left, time_left


@pytest.mark.parametrize(("done", "seconds"), [(0, 10.0), (1, 10.0), (10, 0.5 * OPTIONS.seconds)])
def test_nothing_is_said_before_enough_is_done(done: int, seconds: float):
    assert time_left(done, 20, seconds, later=0.0, again=0.0) is None


@pytest.mark.parametrize(
    ("later", "again", "wanted"), [(0.0, 0.0, 20.0), (0.5, 0.0, 30.0), (0.0, 0.5, 40.0), (0.5, 0.5, 50.0)]
)
def test_later_stages_are_counted(later: float, again: float, wanted: float):
    assert time_left(10, 20, 20.0, later=later, again=again) == wanted


@pytest.mark.parametrize(("later", "again", "wanted"), [(0.0, 0.0, 10.0), (0.5, 0.0, 20.0), (0.0, 0.5, 30.0)])
def test_a_sweep_counts_what_it_found_itself_and_later_stages_of_all(later: float, again: float, wanted: float):
    assert sweep_time_left(15, 20, 20.0, before=5, later=later, again=again) == wanted
    assert sweep_time_left(6, 20, 20.0, before=5, later=later, again=again) is None

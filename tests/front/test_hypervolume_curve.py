"""The hypervolume of a growing front, as long as there is time for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from paretoik.front.indicators import CURVE_OPTIONS as OPTIONS
from paretoik.front.indicators import HypervolumeCurve, estimate_hypervolume, hypervolume


def sphere(points: int, n_obj: int) -> np.ndarray:
    directions = np.abs(np.random.default_rng(3).normal(size=(points, n_obj)))
    return 1.0 - directions / np.linalg.norm(directions, axis=1, keepdims=True)


def test_every_front_is_measured_up_to_the_corner_of_the_first_that_has_points():
    curve, front = HypervolumeCurve(), sphere(50, 3)
    assert curve.measure(front[:0], 1) == 0.0
    assert curve.corner(front[:0]) is None
    values = [curve.measure(front[:size], size) for size in (10, 20, 50)]
    corner = curve.corner(front)
    assert values == [hypervolume(front[:size], corner) for size in (10, 20, 50)]
    assert values == sorted(values)
    assert curve.summary(50) == f"hypervolume {values[-1]:.4g}"


def test_what_takes_too_long_is_left_out_and_the_last_value_says_of_which_generation_it_is():
    curve, front = HypervolumeCurve(replace(OPTIONS, share=1e-6)), sphere(4000, 4)
    for number in (1, 2):  # it is the second that takes some milliseconds and is known to
        volume = curve.measure(front, number)
        assert volume == hypervolume(front, curve.corner(front))
    assert curve.measure(front, 3) is None
    assert curve.summary(3) == f"hypervolume {volume:.4g} of generation 2"


def test_the_time_of_the_processor_counts_so_that_small_fronts_are_measured_on_a_busy_machine():
    curve, front = HypervolumeCurve(replace(OPTIONS, share=0.0)), sphere(30, 2)
    assert curve.measure(front, 1) == curve.measure(front, 2) == pytest.approx(hypervolume(front, curve.corner(front)))


def test_of_many_objectives_the_curve_is_an_estimate_that_is_quick_never_falls_and_knows_no_units(monkeypatch):
    import moocore

    monkeypatch.delattr(moocore, "hypervolume")  # of these it would take a minute
    front = sphere(1000, 7)
    curve, scaled = HypervolumeCurve(replace(OPTIONS, share=1.0)), HypervolumeCurve(replace(OPTIONS, share=1.0))
    units = 10.0 ** np.arange(-3, 4)
    values = [curve.measure(front[:size], size) for size in (50, 400, 1000)]
    assert values == sorted(values)
    assert [scaled.measure(front[:size] * units, size) for size in (50, 400, 1000)] == pytest.approx(values)


def test_a_corner_that_is_given_replaces_that_of_the_first_front():
    front, corner = sphere(60, 5), np.full(5, 1.25)
    curve = HypervolumeCurve()
    values = [curve.measure(front[:size], size, corner) for size in (20, 60)]
    assert values[1] == pytest.approx(estimate_hypervolume(front, corner, corner), rel=0.01)
    assert values[0] < values[1]

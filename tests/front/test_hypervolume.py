"""Hypervolume and non-domination."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from paretoik.front.hypervolume import CURVE_OPTIONS as OPTIONS
from paretoik.front.hypervolume import (
    HypervolumeCurve,
    estimate_hypervolume,
    hypervolume,
    non_dominated,
)

GRID = st.integers(0, 5).map(float)
few = settings(max_examples=40)


def matrices(max_points: int = 12, max_objectives: int = 4):
    shape = st.tuples(st.integers(0, max_points), st.integers(1, max_objectives))
    return shape.flatmap(lambda size: arrays(float, size, elements=st.one_of(GRID, st.just(np.nan), st.just(np.inf))))


def dominates(a: np.ndarray, b: np.ndarray) -> bool:
    return bool((a <= b).all() and (a < b).any())


@few
@given(matrices())
def test_non_dominated_agrees_with_the_definition(F):
    finite = np.isfinite(F).all(axis=1)
    expected = [
        bool(finite[i])
        and not any(finite[j] and dominates(F[j], F[i]) for j in range(len(F)))
        and not any((F[j] == F[i]).all() for j in range(i))
        for i in range(len(F))
    ]
    assert non_dominated(F).tolist() == expected


@few
@given(matrices(max_points=8, max_objectives=3))
def test_hypervolume_counts_the_unit_cells_that_are_dominated(F):
    reference = np.full(F.shape[1], 4.0)
    cells = np.stack(np.meshgrid(*[np.arange(4.0)] * F.shape[1], indexing="ij"), axis=-1).reshape(-1, F.shape[1])
    finite = F[np.isfinite(F).all(axis=1)]
    covered = [any((point <= cell).all() for point in finite) for cell in cells]
    assert hypervolume(F, reference) == pytest.approx(sum(covered), abs=1e-12)


def test_a_tolerance_drops_points_within_that_share_of_the_range_and_keeps_the_first():
    F = np.array([[0.0, 1.0], [1e-9, 1.0 - 1e-9], [0.5, 0.5], [1.0, 0.0]])
    assert non_dominated(F).all()
    assert non_dominated(F, tolerance=1e-7).tolist() == [True, False, True, True]


def test_a_tolerance_keeps_points_that_are_near_in_one_objective_only():
    F = np.array([[0.0, 1.0], [0.005, 0.5], [1.0, 0.0]])
    assert non_dominated(F, tolerance=0.01).all()


@pytest.mark.parametrize("n_obj", [2, 4, 6])
def test_an_estimate_is_near_the_hypervolume_in_any_units_and_exact_up_to_four_objectives(n_obj):
    directions = np.abs(np.random.default_rng(3).normal(size=(200, n_obj)))
    units = 10.0 ** np.linspace(-6, 6, n_obj)
    F = (2.0 - directions / np.linalg.norm(directions, axis=1, keepdims=True)) * units
    F[0], F[1, 0] = np.nan, 9.0 * units[0]  # these are ignored
    volume = hypervolume(F, 2.1 * units)
    estimate = estimate_hypervolume(F, 2.1 * units, 1.1 * units)
    assert estimate == pytest.approx(volume, rel=0.0 if n_obj <= 4 else 0.01)


@few
@given(seed=st.integers(0, 99))
def test_an_estimate_never_falls_if_points_are_added_or_improve(seed):
    rng = np.random.default_rng(seed)
    F, corner = rng.random((30, 6)), np.full(6, 1.1)
    estimate = [estimate_hypervolume(each, corner, corner) for each in (F[:10], F, F - 0.1 * rng.random((30, 6)))]
    assert estimate == sorted(estimate)
    assert estimate_hypervolume(F + 2.0, corner, corner) == 0.0


# The hypervolume of a growing front, while there is time for it.


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


def test_the_curve_of_many_objectives_is_a_quick_estimate_that_never_falls_and_ignores_units(monkeypatch):
    import moocore

    monkeypatch.delattr(moocore, "hypervolume")  # it would take a minute
    front = sphere(1000, 7)
    curve, scaled = HypervolumeCurve(replace(OPTIONS, share=1.0)), HypervolumeCurve(replace(OPTIONS, share=1.0))
    units = 10.0 ** np.arange(-3, 4)
    values = [curve.measure(front[:size], size) for size in (50, 400, 1000)]
    assert values == sorted(values)
    assert [scaled.measure(front[:size] * units, size) for size in (50, 400, 1000)] == pytest.approx(values)

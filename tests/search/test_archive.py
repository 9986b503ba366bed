"""The archive keeps points that the population loses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from paretoik.search.archive import OPTIONS, Archive


def fill(archive, F, *, G=None, first=0, generation=0, causes=None):
    F = np.asarray(F, dtype=float)
    ids = np.arange(first, first + len(F))
    archive.add(ids, np.repeat(ids[:, None].astype(float), 2, axis=1), F, G, generation, causes=causes)
    return archive


def dominates(a, b):
    return (a <= b).all() and (a < b).any()


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 3).flatmap(
        lambda n_obj: hnp.arrays(float, st.tuples(st.integers(1, 25), st.just(n_obj)), elements=st.integers(0, 6))
    ),
    st.integers(1, 5),
)
def test_archive_keeps_the_first_of_each_non_dominated_point_in_any_batches(F, batches):
    archive = Archive()
    first = 0
    for generation, part in enumerate(np.array_split(F, batches)):
        if len(part):
            fill(archive, part, first=first, generation=generation)
        first += len(part)
    expected = [
        one
        for one in range(len(F))
        if not any(dominates(other, F[one]) for other in F) and not any((F[:one] == F[one]).all(axis=1))
    ]
    assert archive.ids.tolist() == expected
    assert np.array_equal(archive.F, F[expected])
    assert np.array_equal(archive.members.X[:, 0], expected)


def test_a_point_nearer_than_rounding_is_the_older_one():
    archive = fill(Archive(), [[0.0, 1.0], [0.5, 0.5], [1.0, 0.0]])
    tolerance = OPTIONS.distance_tolerance
    nearly = [[0.5 - tolerance / 2, 0.5 + tolerance / 2], [0.5 - 3 * tolerance, 0.5 + 3 * tolerance]]
    assert fill(archive, nearly, first=3).ids.tolist() == [0, 1, 2, 4]


def test_only_feasible_and_finite_points_enter_and_failures_are_counted_with_the_first_cause():
    F = [[0, 0], [np.nan, 0], [0, np.inf], [1, 1], [2, 2]]
    G = np.array([[1.0], [-1.0], [-1.0], [1e-12], [np.nan]])
    archive = fill(Archive(names=("energy", "torque")), F, G=G)
    assert archive.ids.tolist() == [3]
    assert archive.failed.count == 3
    assert archive.failed.first_cause == "objective energy is nan"
    named = fill(Archive(), F, G=G, causes={1: "ValueError: no"})
    assert named.failed.first_cause == "ValueError: no"
    assert fill(Archive(), [[1, 1]], G=np.array([[0.0, np.nan]])).failed.first_cause == "constraint 2 is nan"


def test_without_a_feasible_point_the_least_violating_one_is_kept():
    archive = fill(Archive(), [[0, 0], [1, 1], [2, 2]], G=np.array([[3.0], [1.0], [np.nan]]))
    fill(archive, [[3, 3]], G=np.array([[2.0]]), first=3)
    assert len(archive) == 0
    assert archive.least_violating.ids.tolist() == [1]
    fill(archive, [[9, 9]], G=np.array([[0.0]]), first=4)
    assert archive.least_violating is None
    assert archive.ids.tolist() == [4]


@pytest.mark.parametrize("n_obj", [2, 3])
def test_grid_thins_a_full_archive_but_keeps_the_extremes(n_obj):
    F = np.abs(np.random.default_rng(2).normal(size=(1200, n_obj)))
    F /= np.linalg.norm(F, axis=1, keepdims=True)
    archive = fill(Archive(capacity=1000), F)
    assert 100 < len(archive) <= 500
    assert np.isin(F.argmin(axis=0), archive.ids).all()
    assert np.array_equal(archive.F, F[archive.ids])
    gaps = np.sort(archive.F[:, 0])
    assert n_obj > 2 or np.diff(gaps).max() < 0.05


def test_a_point_far_from_the_others_is_kept_though_it_is_better_by_a_hair_only():
    archive = fill(Archive(), [[0.0, 1.0], [1.0, 0.0]])
    fill(archive, [[0.5, 1.0 - 1e-10]], first=2)
    assert archive.ids.tolist() == [0, 1, 2]

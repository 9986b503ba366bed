"""Comparison of fronts: every number agrees with brute force; units, signs and order change none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.errors import InvalidInput
from paretoik.front.comparison import Comparison, comparison_entries
from paretoik.front.front import Front
from paretoik.front.hypervolume import non_dominated
from paretoik.front.points import StoredJoints, StoredMotions


def make(values: np.ndarray, *, first_id: int = 0, maximised=None, **parts) -> Front:
    """Return the non-dominated points as a front."""
    values = values[non_dominated(values)]
    n_obj = values.shape[1]
    signs = np.where(maximised, -1.0, 1.0) if maximised else np.ones(n_obj)
    return Front(
        ids=np.arange(len(values)) + first_id, objectives=values * signs, names=[f"f{k}" for k in range(n_obj)],
        units=["m"] * n_obj, maximised=maximised or [False] * n_obj, **parts,
    )  # fmt: skip


def compared(*fronts: Front, labels=None) -> Comparison:
    return Comparison(fronts=fronts, labels=tuple(labels or [f"run {k}" for k in range(len(fronts))]))


@st.composite
def several(draw) -> list[np.ndarray]:
    """Draw points on a coarse grid, so that equal points and ties are common."""
    n_obj, count = draw(st.integers(1, 4)), draw(st.integers(2, 4))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    return [rng.integers(0, 7, (draw(st.integers(1, 9)), n_obj)).astype(float) for _ in range(count)]


def dominates_weakly(one: np.ndarray, other: np.ndarray) -> bool:
    return bool((one <= other).all())


@settings(max_examples=15)
@given(several())
def test_coverage_epsilon_and_merged_front_agree_with_brute_force(values):
    fronts = [make(each) for each in values]
    comparison = compared(*fronts)
    F = [front.minimised for front in fronts]
    everything = np.concatenate(F)
    merged = np.array([p for p in everything if not any(dominates_weakly(q, p) and (q < p).any() for q in everything)])
    width = np.ptp(merged, axis=0)
    width = np.where(width > 0, width, np.ptp(everything, axis=0))
    width = np.where(width > 0, width, 1.0)
    for i, one in enumerate(F):
        assert comparison.on_merged[i] == sum(any((p == q).all() for q in merged) for p in one)
        for j, other in enumerate(F):
            covered = [any(dominates_weakly(p, q) for p in one) for q in other]
            assert comparison.coverage[i, j] == np.mean(covered)
            least = max(min(max((p - q) / width) for p in one) for q in other)
            assert comparison.epsilon[i, j] == pytest.approx(least, abs=1e-12)


@settings(max_examples=15)
@given(several())
def test_hypervolume_is_the_share_of_the_merged_fronts_and_one_for_it(values):
    fronts = [make(each) for each in values]
    comparison = compared(*fronts)
    assert (comparison.hypervolume <= 1 + 1e-12).all()
    whole = make(np.concatenate([front.minimised for front in fronts]))
    assert compared(whole, *fronts).hypervolume == pytest.approx([1.0, *comparison.hypervolume])
    assert len(whole) == sum(map(len, comparison.merged_rows))


@settings(max_examples=15)
@given(several(), st.integers(0, 10**6))
def test_units_signs_and_order_do_not_matter(values, seed):
    rng = np.random.default_rng(seed)
    n_obj = values[0].shape[1]
    scale, shift = 10.0 ** rng.integers(-6, 7, n_obj), rng.normal(size=n_obj)
    maximised = [bool(flag) for flag in rng.integers(0, 2, n_obj)]
    first = compared(*(make(each) for each in values))
    other = compared(*(make(scale * (each + shift), maximised=maximised) for each in values))
    order = rng.permutation(len(values))
    turned = compared(*(make(values[place]) for place in order))
    for name in ("hypervolume", "coverage", "epsilon", "on_merged"):
        value = getattr(first, name)
        assert getattr(other, name) == pytest.approx(value, abs=1e-9)
        assert getattr(turned, name) == pytest.approx(value[np.ix_(*[order] * value.ndim)], abs=1e-12)


@settings(max_examples=15)
@given(st.integers(0, 10**6), st.integers(2, 3), st.sampled_from([0.2, 0.5, 0.75, 1.0]), st.booleans())
def test_an_attainment_surface_is_what_that_share_of_the_runs_reaches(seed, n_obj, share, maximise):
    rng = np.random.default_rng(seed)
    maximised = [maximise] + [False] * (n_obj - 1)
    fronts = [make(rng.integers(0, 6, (5, n_obj)).astype(float), maximised=maximised) for _ in range(4)]
    surface = compared(*fronts).attainment(share) * np.where(maximised, -1.0, 1.0)
    grid = np.stack(np.meshgrid(*[np.arange(6.0)] * n_obj), axis=-1).reshape(-1, n_obj)
    runs = np.array([[any(dominates_weakly(p, q) for p in front.minimised) for q in grid] for front in fronts])
    attained = runs.sum(axis=0) >= share * len(fronts)
    below = np.array([any(dominates_weakly(p, q) for p in surface) for q in grid])
    np.testing.assert_array_equal(below, attained)


def test_the_surfaces_of_a_label_are_what_one_run_half_and_all_attain():
    rng = np.random.default_rng(2)
    comparison = compared(*(make(rng.uniform(size=(8, 2))) for _ in range(5)), labels=["a", "b", "a", "a", "b"])
    for label, count in ((None, 5), ("a", 3), ("b", 2)):
        for name, share in (("best", 1 / count), ("median", 0.5), ("worst", 1.0)):
            np.testing.assert_array_equal(comparison.surfaces(label)[name], comparison.attainment(share, label))
    told = comparison_entries(comparison)["attainment"]
    assert list(told["labels"]) == ["a", "b"]
    values = np.concatenate([front.objectives for front in comparison.fronts])
    np.testing.assert_array_equal(np.sort(told["all"]["best"], axis=0), np.sort(values[non_dominated(values)], axis=0))
    assert comparison_entries(compared(make(np.eye(4)), make(np.eye(4))))["attainment"] is None


def test_what_cannot_be_compared_is_refused_by_name():
    front = make(np.eye(2))
    with pytest.raises(InvalidInput, match="there must be at least two fronts, got 1"):
        compared(front)
    with pytest.raises(InvalidInput, match="labels must be one for each of 2 fronts, got 1"):
        compared(front, front, labels=["a"])
    for part, words in (({"names": ["f0", "g"]}, "names .* got f0, f1 in run 0 and f0, g in run 1"),
                        ({"units": ["m", ""]}, "units .* got m, m in run 0 and m, none in run 1")):  # fmt: skip
        with pytest.raises(InvalidInput, match=words):
            compared(front, replace(front, **part))
    with pytest.raises(InvalidInput, match="maximised"):
        compared(front, make(np.eye(2), maximised=[True, False]))
    empty = replace(front, ids=np.zeros(0, int), objectives=np.zeros((0, 2)))
    with pytest.raises(InvalidInput, match="at least one point, got none in run 1"):
        compared(front, empty)


def moving(values: np.ndarray, *, samples: int = 5, joints=("a", "b"), **parts) -> Front:
    motions = StoredMotions(
        arm=StoredJoints(joint_names=joints),
        time=np.tile(np.arange(float(samples)), (len(values), 1)),
        q=np.random.default_rng(len(values)).normal(size=(len(values), samples, len(joints))),
    )
    return Front(
        ids=np.arange(len(values)) * 3, objectives=values, names=["f0", "f1"], units=["", ""], maximised=[False, False],
        motions=motions, violation=np.arange(float(len(values))), **parts,
    )  # fmt: skip


A = np.array([[0.0, 5.0], [2.0, 2.0], [5.0, 0.0]])
B = np.array([[1.0, 3.0], [2.0, 2.0], [6.0, -1.0], [7.0, -2.0]])


def test_a_merged_front_says_where_each_point_comes_from():
    a, b = moving(A, provenance={"fingerprint": "x", "problem": "p.py:f"}), moving(B, provenance={"fingerprint": "x"})
    comparison = compared(a, b, labels=["same", "same"])  # two seeds of one method
    merged = comparison.merged
    assert merged.ids.tolist() == [0, 3, 1, 2, 4, 5]
    assert comparison.origins == {0: (0, 0), 1: (0, 3), 2: (0, 6), 3: (1, 0), 4: (1, 6), 5: (1, 9)}
    for row, number in enumerate(merged.ids):
        place, old = comparison.origins[int(number)]
        source = comparison.fronts[place]
        (there,) = np.flatnonzero(source.ids == old)
        np.testing.assert_array_equal(merged.objectives[row], source.objectives[there])
        np.testing.assert_array_equal(merged.motions.q[row], source.motions.q[there])
        assert merged.violation[row] == source.violation[there]
    assert merged.provenance["problem"] == "p.py:f"
    assert merged.provenance["merged"]["left_out"] == []


def test_the_text_gives_normalisation_numbers_and_only_settings_that_differ():
    one = moving(A, provenance={"settings": {"seed": 1, "population": 20}, "counts": {"seconds": 1.0}})
    other = moving(B, provenance={"settings": {"seed": 2, "population": 20}, "counts": {"seconds": 2.0}})
    comparison = compared(one, other, labels=["<a>", "b"])
    text = str(comparison)
    assert "best to worst: f0 0 to 7, f1 -2 to 5" in text
    lines = [line.split() for line in text.splitlines()]
    assert ["<a>", "3", "3", f"{comparison.hypervolume[0]:.4f}"] in lines
    assert ["b", "–", f"{comparison.coverage[0, 1]:.4f}"] not in lines
    assert ["<a>", "–", f"{comparison.coverage[0, 1]:.4f}"] in lines
    assert ["b", f"{comparison.epsilon[1, 0]:.4f}", "–"] in lines
    assert text.endswith("settings.seed  1    2")
    assert "population" not in text
    html = comparison._repr_html_()
    assert "<a>" not in html
    assert "&lt;a&gt;" in html
    assert "<script" not in html
    assert comparison_entries(comparison)["differences"] == {"settings.seed": ("1", "2")}

"""The first population."""

from __future__ import annotations

import numpy as np
import pytest
from pymoo.core.problem import Problem

from paretoik.errors import InvalidInput
from paretoik.inputs import check_size
from paretoik.search.ask_tell import Search
from paretoik.search.genes import seeded_population
from paretoik.search.nsga2 import MaxiMinNSGA2


class Structured(Problem):
    def __init__(self):
        super().__init__(n_var=2, n_obj=2, xl=0.0, xu=1.0)

    def sample_starts(self, n, rng):
        return np.column_stack((np.full(n, 0.25), rng.random(n)))

    def self_motion_samples(self, n, rng):
        return np.column_stack((np.full(n, 0.75), rng.random(n)))


def plain(xl=0.0, xu=1.0):
    return Problem(n_var=2, n_obj=2, xl=xl, xu=xu)


def rng():
    return np.random.default_rng(0)


def test_a_third_each_comes_from_candidates_self_motion_and_chance_after_the_initial_rows():
    X = seeded_population(Structured(), 30, [[0.5, 0.5], [0.1, 0.2]], rng=rng())
    assert X.shape == (30, 2)
    assert X[:2].tolist() == [[0.5, 0.5], [0.1, 0.2]]
    assert (X[2:12, 0] == 0.25).all()
    assert (X[12:22, 0] == 0.75).all()
    assert not np.isin(X[22:, 0], (0.25, 0.75)).any()


@pytest.mark.parametrize("size", [4, 5, 17])
def test_few_or_equal_seeds_are_topped_up_to_exactly_the_size(size):
    X = seeded_population(plain(), size, [[0.5, 0.0], [0.5, -0.0], [0.5, 0.0]], rng=rng())
    assert X.shape == (size, 2)
    assert len(np.unique(X, axis=0)) == size


def test_a_box_without_room_is_filled_with_copies():
    X = seeded_population(plain(0.5, 0.5), 6, rng=rng())
    assert (X == 0.5).all()
    assert X.shape == (6, 2)


def test_rounding_is_clipped_and_anything_more_is_refused_with_row_and_gene():
    X = seeded_population(plain(), 4, [[1.0 + 1e-13, -1e-13]], rng=rng())
    assert X[0].tolist() == [1.0, 0.0]
    with pytest.raises(InvalidInput, match=r"initial\[1\]: gene 0 between 0.0 and 1.0 wanted, got 1.001"):
        seeded_population(plain(), 4, [[0.1, 0.1], [1.001, 0.1]], rng=rng())
    with pytest.raises(InvalidInput, match=r"initial\[0\]: gene 1 .* got nan"):
        seeded_population(plain(), 4, [[0.1, np.nan]], rng=rng())


@pytest.mark.parametrize("initial", [np.zeros((2, 3)), np.zeros((1, 2, 2))])
def test_initial_genes_of_another_shape_are_refused(initial):
    with pytest.raises(InvalidInput, match="initial: rows of 2 genes wanted, got shape"):
        seeded_population(plain(), 4, initial, rng=rng())


def test_more_initial_rows_than_places_are_refused_and_not_dropped():
    with pytest.raises(InvalidInput, match=r"initial: at most 4 rows wanted .*, got 5"):
        seeded_population(plain(), 4, rng().random((5, 2)), rng=rng())


@pytest.mark.parametrize("size", [0, 1, 2, 3, -5])
def test_populations_below_four_are_refused_by_name_and_value(size):
    with pytest.raises(InvalidInput, match=f"population: an integer of at least 4 wanted, got {size}"):
        Search(plain(), population=size)
    with pytest.raises(InvalidInput, match=f"pop_size: an integer of at least 4 wanted, got {size}"):
        MaxiMinNSGA2(pop_size=size)


@pytest.mark.parametrize("size", [4.0, True, None, "9"])
def test_sizes_that_are_no_integers_are_refused(size):
    with pytest.raises(InvalidInput, match=f"population: an integer of at least 0 wanted, got {size!r}"):
        check_size("population", size, 0)


@pytest.mark.parametrize(
    ("xl", "xu", "message"),
    [
        ([0.0, 2.0], [1.0, 1.0], "bounds of gene 1: xl <= xu wanted, got 2.0 > 1.0"),
        ([0.0, np.nan], [1.0, 1.0], r"xl\[1\]: a finite bound wanted, got nan"),
        ([0.0, 0.0], [np.inf, 1.0], r"xu\[0\]: a finite bound wanted, got inf"),
        ([0.0], [1.0, 1.0], "xl: 2 bounds wanted, one a gene, got shape"),
        (None, [1.0, 1.0], "xl: 2 bounds wanted, one a gene, got none"),
    ],
)
def test_bounds_that_cannot_be_used_are_refused_by_name_and_value(xl, xu, message):
    problem = plain(None if xl is None else np.array(xl), np.array(xu))
    with pytest.raises(InvalidInput, match=message):
        Search(problem)


def test_genes_that_are_not_real_are_refused():
    with pytest.raises(InvalidInput, match="genes: real numbers wanted, got <class 'bool'>"):
        Search(Problem(n_var=2, n_obj=2, xl=0, xu=1, vtype=bool))

"""Sparse products have the structure that their factors' structures define."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from paretoik.nlp.program import Structure, structural_product


@pytest.mark.parametrize("seed", range(5))
def test_a_structural_product_is_the_product_and_keeps_sums_that_are_zero_by_chance(seed):
    rng = np.random.default_rng(seed)
    rows, inner, columns = rng.integers(1, 30, 3)
    left, right = (
        sparse.csr_array(sparse.random_array(shape, density=0.2, rng=rng))
        for shape in ((rows, inner), (inner, columns))
    )
    everywhere = Structure.of(structural_product(left, right))
    for matrix in (left, right):
        matrix.data = rng.integers(-1, 2, len(matrix.data)).astype(float)
    product = structural_product(left, right)
    product.check_format()
    np.testing.assert_array_equal(product.toarray(), left.toarray() @ right.toarray())
    assert Structure.of(product) == everywhere

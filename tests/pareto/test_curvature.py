"""The null space of rows on unknowns and auxiliary columns."""

import numpy as np
import pytest
from scipy import sparse

from paretoik.nlp.program import Constraints
from paretoik.pareto.certificates import least_multipliers, null_space


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("auxiliary", [0, 1, 7])
def test_null_space_does_not_depend_on_eliminated_columns(seed, auxiliary):
    rng = np.random.default_rng(seed)
    unknowns, rest = 9, 4
    rows = np.zeros((auxiliary + rest + 2, unknowns + auxiliary))
    rows[:, :unknowns] = rng.normal(size=(len(rows), unknowns)) * 10.0 ** rng.integers(-3, 4, (len(rows), 1))
    rows[:auxiliary, unknowns:] = np.eye(auxiliary)  # ties
    rows[auxiliary + 1, unknowns:] = rng.normal(size=auxiliary)  # the gradient of an objective
    rows[-1] = rows[auxiliary : auxiliary + 2].sum(axis=0)  # depends on others
    order = rng.permutation(len(rows))
    whole, reduced = null_space(rows), null_space(rows[order], unknowns)
    assert whole.shape == reduced.shape
    assert (
        np.abs(rows / np.linalg.norm(rows, axis=1, keepdims=True) @ (reduced / np.linalg.norm(reduced, axis=0))).max()
        < 1e-12
    )
    assert reduced[:unknowns].T @ reduced[:unknowns] == pytest.approx(np.eye(reduced.shape[1]), abs=1e-12)
    assert np.linalg.matrix_rank(np.hstack([whole, reduced])) == whole.shape[1]


def test_a_tie_counts_by_its_share_of_what_it_ties_and_a_limit_by_its_own_size():
    jacobian = sparse.csr_array(
        [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
    )
    multipliers = np.array([1e-7, 5e-8, 5e-8, 1e-2, 1e-8, 1e-5])  # a limit, a kink of little weight, another, a limit
    constraints = Constraints(unknowns=1, values=np.zeros(6), jacobian=jacobian)
    counts = multipliers > least_multipliers(constraints, multipliers)
    assert counts.tolist() == [False, True, True, True, False, True]
    assert (least_multipliers(constraints, 1e-8 * multipliers) >= 1e-9).all()

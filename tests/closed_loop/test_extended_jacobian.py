"""Genes to joint positions beside the extended Jacobian's dense solution (Marcos 2012, Eqs. 7, 12 and 13)."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.closed_loop.engine import decode
from paretoik.closed_loop.workspace import StepStart


@pytest.mark.parametrize(("dof", "rows"), [(3, 2), (4, 2), (5, 2), (7, 3), (7, 6)])
def test_steps_solve_the_extended_jacobian(dof, rows):
    rng, batch, redundancy = np.random.default_rng(dof), 25, dof - rows
    jacobian, change, previous = rng.normal(size=(rows, dof)), rng.normal(size=rows), rng.normal(size=dof)
    particular = np.linalg.pinv(jacobian) @ change
    null_space = np.ascontiguousarray(np.linalg.svd(jacobian)[2][rows:].T)
    start = StepStart(previous, particular, null_space, np.zeros((3, dof)), 0.1)
    genes = rng.uniform(-1, 1, size=(redundancy * (dof + 1), batch))
    q = np.full((dof, batch), np.nan)
    decode(genes, batch, start, np.empty((redundancy * (redundancy + 1), batch)), q)
    for k in range(batch):
        extra = genes[:, k].reshape(redundancy, dof + 1)
        extended, right = np.concatenate([jacobian, extra[:, :dof]]), np.concatenate([change, extra[:, dof]])
        expected = previous + np.linalg.solve(extended, right)
        scale = np.linalg.cond(extended) * (1 + np.abs(expected).max())
        np.testing.assert_allclose(q[:, k], expected, atol=1e-13 * scale)

"""The convex subproblem: Clarabel on our canonical form compared with cvxpy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from paretoik.nlp.convex_subproblem import solve_subproblem
from paretoik.nlp.program import Cone, Constraints
from studies.benchmarks.refinement.stated import solve_with_cvxpy


def random_model(seed, *, unknowns=20, extra=4, limits=40):
    """Return a quadratic model; its last columns have no box, and a strict limit ties each from below."""
    rng = np.random.default_rng(seed)
    columns = unknowns + extra
    root = rng.normal(size=(unknowns, unknowns)) / 4
    hessian = np.zeros((columns, columns))
    hessian[:unknowns, :unknowns] = root @ root.T
    slopes = sparse.random_array((limits, columns), density=0.2, rng=rng).toarray()
    slopes[:, unknowns:] = 0.0
    ties = np.concatenate([rng.normal(size=(2 * extra, unknowns)), np.tile(np.eye(extra), (2, 1))], axis=1)
    gradient = np.concatenate([rng.normal(size=unknowns), np.ones(extra)])
    gaps = np.concatenate([rng.uniform(-0.02, 0.3, size=limits), rng.uniform(0, 0.2, size=2 * extra)])
    constraints = Constraints(unknowns=unknowns, values=gaps, jacobian=sparse.csr_array(np.concatenate([slopes, ties])))
    return gradient, sparse.csr_array(hessian), constraints


def objective(model, solution, penalty):
    gradient, hessian, _ = model
    return gradient @ solution.step + solution.step @ (hessian @ solution.step) / 2 + penalty * solution.violation


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("penalty", "cones"), [(0.5, 0), (50.0, 0), (5.0, 1)])
def test_clarabel_and_cvxpy_agree(seed, penalty, cones):
    gradient, hessian, within = random_model(seed)
    rng = np.random.default_rng(seed)
    rows = sparse.csr_array(np.pad(rng.normal(size=(3, 20)), ((0, 0), (0, 4))))
    within = replace(within, cones=cones * (Cone(column=21, values=rng.normal(size=3), rows=rows),))
    model = gradient, hessian, within
    ours = solve_subproblem(*model, elastic=40, radius=0.3, penalty=penalty)
    theirs = solve_with_cvxpy(*model, elastic=40, radius=0.3, penalty=penalty)
    assert objective(model, ours, penalty) == pytest.approx(objective(model, theirs, penalty), abs=1e-6)
    assert ours.violation == pytest.approx(theirs.violation, abs=1e-5)
    assert ours.multipliers == pytest.approx(theirs.multipliers, abs=1e-3)
    for mine, other in zip(ours.cone_multipliers, theirs.cone_multipliers, strict=True):
        assert mine == pytest.approx(other, abs=1e-3)


def test_without_limits_a_small_step_is_newtons():
    hessian = sparse.csr_array(np.diag([2.0, 4.0]))
    within = Constraints(unknowns=2, values=np.empty(0), jacobian=sparse.csr_array((0, 2)))
    solution = solve_subproblem(np.array([-0.2, 0.4]), hessian, within, elastic=0, radius=1.0, penalty=1.0)
    assert solution.step == pytest.approx([0.1, -0.1], abs=1e-8)


def test_a_limit_that_cannot_be_kept_within_the_box_is_kept_as_far_as_it_can():
    wall = Constraints(unknowns=1, values=np.array([-1.0]), jacobian=sparse.csr_array(np.ones((1, 1))))
    solution = solve_subproblem(np.zeros(1), sparse.csr_array((1, 1)), wall, elastic=1, radius=0.25, penalty=10.0)
    assert solution.step == pytest.approx([0.25], abs=1e-7)
    assert solution.violation == pytest.approx(0.75, abs=1e-7)

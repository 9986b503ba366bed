from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from paretoik.nlp.conic import Cone, Constraints
from paretoik.nlp.subproblem import step, step_model


def random_model(seed, *, unknowns=20, extra=4, limits=40):
    """A quadratic model whose last columns have no box, each tied from below by a limit that may not yield."""
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


def worth(model, found, price):
    gradient, hessian, _ = model
    return gradient @ found.step + found.step @ (hessian @ found.step) / 2 + price * found.violation


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("price", [0.5, 50.0])
def test_clarabel_and_cvxpy_agree(seed, price):
    model = random_model(seed)
    ours = step(*model, yielding=40, radius=0.3, price=price)
    theirs = step_model(*model, yielding=40, radius=0.3, price=price)
    assert worth(model, ours, price) == pytest.approx(worth(model, theirs, price), abs=1e-6)
    assert ours.violation == pytest.approx(theirs.violation, abs=1e-5)
    assert ours.limits == pytest.approx(theirs.limits, abs=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_clarabel_and_cvxpy_agree_about_cones(seed):
    gradient, hessian, within = random_model(seed)
    rng = np.random.default_rng(seed)
    rows = sparse.csr_array(np.pad(rng.normal(size=(3, 20)), ((0, 0), (0, 4))))
    within = replace(within, cones=(Cone(column=21, values=rng.normal(size=3), rows=rows),))
    model = gradient, hessian, within
    ours = step(*model, yielding=40, radius=0.3, price=5.0)
    theirs = step_model(*model, yielding=40, radius=0.3, price=5.0)
    assert worth(model, ours, 5.0) == pytest.approx(worth(model, theirs, 5.0), abs=1e-6)
    assert ours.pulls[0] == pytest.approx(theirs.pulls[0], abs=1e-3)


def test_without_limits_a_small_step_is_newtons():
    hessian = sparse.csr_array(np.diag([2.0, 4.0]))
    within = Constraints(unknowns=2, values=np.empty(0), jacobian=sparse.csr_array((0, 2)))
    found = step(np.array([-0.2, 0.4]), hessian, within, yielding=0, radius=1.0, price=1.0)
    assert found.step == pytest.approx([0.1, -0.1], abs=1e-8)


def test_a_limit_that_cannot_be_kept_within_the_box_is_kept_as_far_as_it_can():
    wall = Constraints(unknowns=1, values=np.array([-1.0]), jacobian=sparse.csr_array(np.ones((1, 1))))
    found = step(np.zeros(1), sparse.csr_array((1, 1)), wall, yielding=1, radius=0.25, price=10.0)
    assert found.step == pytest.approx([0.25], abs=1e-7)
    assert found.violation == pytest.approx(0.75, abs=1e-7)

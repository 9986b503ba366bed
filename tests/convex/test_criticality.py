import numpy as np
import pytest
from scipy import sparse

from paretoik.convex.criticality import criticality, criticality_model


def random_point(seed, *, objectives=2, unknowns=40, limits=90):
    rng = np.random.default_rng(seed)
    slopes = sparse.csr_array(sparse.random_array((limits, unknowns), density=0.1, rng=rng))
    return rng.normal(size=(objectives, unknowns)), rng.uniform(0, 0.3, size=limits), slopes


@pytest.mark.parametrize("seed", range(5))
def test_clarabel_and_cvxpy_agree(seed):
    point = random_point(seed, objectives=1 + seed % 3)
    ours, model = criticality(*point, radius=3.0), criticality_model(*point, radius=3.0)
    assert ours.value == pytest.approx(model.value, rel=1e-6)
    assert ours.weights == pytest.approx(model.weights, abs=1e-4)


def test_without_limits_one_objective_gains_its_slope_times_the_radius():
    gradient = np.array([[3.0, 4.0]])
    found = criticality(gradient, np.empty(0), sparse.csr_array((0, 2)), radius=2.0)
    assert found.value == pytest.approx(10.0, rel=1e-8)
    assert found.direction == pytest.approx([-1.2, -1.6], abs=1e-6)


def test_opposed_gradients_leave_nothing_to_gain_and_weights_that_balance():
    found = criticality(np.array([[1.0, 0.0], [-3.0, 0.0]]), np.empty(0), sparse.csr_array((0, 2)), radius=1.0)
    assert found.value == pytest.approx(0.0, abs=1e-9)
    assert found.weights == pytest.approx([0.75, 0.25], abs=1e-6)


def test_a_limit_that_is_reached_takes_the_gain_and_its_multiplier_says_so():
    slopes = sparse.csr_array(np.array([[-1.0, 0.0]]))
    found = criticality(np.array([[2.0, 0.0]]), np.zeros(1), slopes, radius=1.0)
    assert found.value == pytest.approx(0.0, abs=1e-9)
    assert found.limits == pytest.approx([2.0], abs=1e-6)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_the_criticality_scales_with_the_objectives(factor):
    gradients, gaps, slopes = random_point(0)
    plain = criticality(gradients, gaps, slopes, radius=1.0).value
    assert criticality(factor * gradients, gaps, slopes, radius=1.0).value == pytest.approx(factor * plain, rel=1e-6)


def test_limits_out_of_reach_change_nothing():
    gradients, gaps, slopes = random_point(1)
    found = criticality(gradients, gaps + 100.0, slopes, radius=1.0)
    free = criticality(gradients, np.empty(0), slopes[:0], radius=1.0)
    assert found.value == pytest.approx(free.value, rel=1e-9)
    assert not found.limits.any()

"""Laws of a step within limits: it solves its quadratic program, which other solvers solve too."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear, nnls

from paretoik.resolution.constrained import StepGoal, StepLimits, limited_step
from paretoik.resolution.protocol import STATUS

SEEDS = range(12)


def random_goal(rng, *, region=0.0, damping=0.02):
    rows, dof = rng.choice([(2, 3), (2, 5), (6, 7), (3, 7)])
    return StepGoal(
        jacobian=rng.normal(size=(rows, dof)),
        task_rates=rng.normal(size=rows),
        secondary=0.3 * rng.normal(size=dof),
        inverse_weights=rng.uniform(0.3, 3.0, dof),
        region=region,
        damping=damping,
    )


def bounded(rates, *, distances=None):
    gradients, least = (np.zeros((0, len(rates))), np.zeros(0)) if distances is None else distances
    return StepLimits(bounds=np.stack([-rates, rates], axis=-1), gradients=gradients, lowest_rates=least)


def least_distance(goal, limits):
    """Return the step by Lawson & Hanson's least distance programming, equations being pairs of inequalities."""
    root, identity = np.sqrt(goal.inverse_weights), np.eye(len(goal.secondary))
    G = np.concatenate([goal.jacobian, -goal.jacobian, limits.gradients, identity, -identity])
    h = np.concatenate(
        [goal.task_rates, -goal.task_rates, limits.lowest_rates, limits.bounds[:, 0], -limits.bounds[:, 1]]
    )
    scaled, right = G * root, h - G @ goal.secondary
    weights, distance = nnls(np.vstack([scaled.T, right]), np.append(np.zeros(len(root)), 1.0))
    residual = np.vstack([scaled.T, right]) @ weights - np.append(np.zeros(len(root)), 1.0)
    return None if distance < 1e-9 else goal.secondary - root * residual[:-1] / residual[-1]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_step_is_the_solution_of_its_program(seed):
    rng = np.random.default_rng(seed)
    goal = random_goal(rng)
    dof = len(goal.secondary)
    free = limited_step(goal, bounded(np.full(dof, 1e3))).rates
    beside = free + rng.normal(size=dof) @ limited_step(goal, bounded(np.full(dof, 1e3))).projector.T
    gradients = rng.normal(size=(2, dof))
    distances = gradients, gradients @ beside - 0.1  # what is beside the free rates keeps them
    limits = bounded(np.maximum(np.abs(beside) * 1.05, 0.7 * np.abs(free)), distances=distances)
    step, expected = limited_step(goal, limits), least_distance(goal, limits)
    assert not limits.keep(free, free)
    assert STATUS[step.status] == "done"
    np.testing.assert_allclose(goal.jacobian @ step.rates, goal.task_rates, atol=1e-12)
    assert limits.keep(step.rates, step.free)
    np.testing.assert_allclose(step.rates, expected, atol=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_without_limits_near_it_is_the_weighted_pseudoinverse(seed):
    goal = random_goal(np.random.default_rng(seed))
    root = np.sqrt(goal.inverse_weights)
    inverse = root[:, None] * np.linalg.pinv(goal.jacobian * root)
    expected = goal.secondary + inverse @ (goal.task_rates - goal.jacobian @ goal.secondary)
    np.testing.assert_allclose(limited_step(goal, bounded(np.full(len(root), 1e3))).rates, expected, atol=1e-12)


@pytest.mark.parametrize("region", [0.0, 1e3])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_task_gives_way_in_least_squares(seed, region):
    goal = random_goal(np.random.default_rng(seed), region=region, damping=0.3)
    dof, root = len(goal.secondary), np.sqrt(goal.inverse_weights)
    limits = bounded(np.full(dof, 0.05))
    step = limited_step(goal, limits)
    assert STATUS[step.status] == ("damped" if region else "limited")
    A = np.concatenate([goal.jacobian, np.diag(step.damping / root)])
    b = np.concatenate([goal.task_rates, step.damping * goal.secondary / root])
    expected = lsq_linear(A, b, (limits.bounds[:, 0], limits.bounds[:, 1]), tol=1e-14).x
    np.testing.assert_allclose(step.rates, expected, atol=1e-7)
    assert limits.keep(step.rates, step.free)


def test_a_singular_jacobian_without_damping_is_held():
    goal = random_goal(np.random.default_rng(0), damping=0.0)
    goal.jacobian[1] = 2 * goal.jacobian[0]
    step = limited_step(goal, bounded(np.ones(len(goal.secondary))))
    assert STATUS[step.status] == "held"
    assert (step.rates == 0).all()


def test_bounds_are_kept_where_a_distance_cannot_be():
    goal = random_goal(np.random.default_rng(1))
    dof = len(goal.secondary)
    limits = bounded(np.full(dof, 0.1), distances=(np.ones((1, dof)), np.array([2.0])))
    step = limited_step(goal, limits)
    assert STATUS[step.status] == "limited"
    np.testing.assert_allclose(step.rates, 0.1, atol=1e-7)


def test_an_arm_that_is_held_still_moves_away_from_an_obstacle():
    goal = StepGoal(
        jacobian=np.ones((2, 3)),
        task_rates=np.ones(2),
        secondary=np.zeros(3),
        inverse_weights=np.ones(3),
        region=0.0,
        damping=0.0,
    )
    limits = bounded(np.ones(3), distances=(np.array([[1.0, 0.0, 0.0]]), np.array([0.5])))
    step = limited_step(goal, limits)
    np.testing.assert_allclose(step.rates, [0.5, 0.0, 0.0], atol=1e-6)
    assert STATUS[step.status] == "held"

"""Laws of ``ConstrainedQP``: every step satisfies all limits, or its status says that it cannot."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear, nnls

import paretoik as pk
from paretoik import Limits, line
from paretoik.errors import Infeasible, InvalidInput
from paretoik.resolution.constrained import RateLimits, StepGoal, StepLimits, highest_rate, intersection, limited_step
from paretoik.resolution.protocol import STATUS
from paretoik.robot import kinematics
from paretoik.robot.arms import tringali_3r
from paretoik.task.validation import motion_task
from tests.resolution.test_resolve import ARMS, CRITERIA, FEEDBACK, START, begun, every_arm

DOWN = line([0.468, 0.0], [0.368, 0.0], duration=1.0, samples=51)
FREE = Limits(position=12.0, velocity=np.inf)
QP = pk.methods.ConstrainedQP()


def down(limits, method=QP, **settings):
    return pk.resolve(tringali_3r(), DOWN, method, start=START, limits=limits, **settings)


def worst_violations(motion, limits):
    """Return the worst violation of every limit, by name, as the library computes it."""
    task = motion_task(
        motion.arm,
        motion.tasks,
        objectives=[pk.joint_travel],
        limits=limits,
        obstacles=motion.obstacles,
        link_radius=motion.link_radius,
        differences="backward",
    )
    return dict(zip(task.limit_names, task.violations(motion), strict=True))


@every_arm
def test_constrained_steps_without_near_limits_are_gradient_projection(name):
    make, start = ARMS[name]
    arm, motions = make(), []
    for method in (pk.methods.GradientProjection, pk.methods.ConstrainedQP):
        resolver = method(criteria=CRITERIA, feedback=FEEDBACK)
        motions.append(pk.resolve(arm, begun(arm, start), resolver, start=start, limits=FREE, tolerance=0.1))
    one, other = motions
    np.testing.assert_allclose(one.q, other.q, rtol=0, atol=1e-12)
    for traced in ("errors", "velocities", "projected", "coefficients", "repulsion"):
        np.testing.assert_allclose(getattr(one.traces, traced), getattr(other.traces, traced), atol=1e-10)
    assert (other.traces.active == "").all()


@every_arm
def test_steps_end_on_the_path(name):
    make, start = ARMS[name]
    arm = make()
    motion = pk.resolve(arm, begun(arm, start), QP, start=start, limits=FREE)
    assert motion.tracking_error[1:].max() < 2e-12


@pytest.mark.parametrize("seed", range(2))
def test_every_limit_is_kept_at_every_step_of_random_arms(seed):
    rng = np.random.default_rng(seed)
    dof = int(rng.integers(3, 7))
    arm = pk.Arm.planar(lengths=rng.uniform(0.2, 0.5, dof), masses=np.ones(dof), centers=np.full(dof, 0.1),
                        inertias=np.full(dof, 0.01))  # fmt: skip
    start = rng.uniform(-1.2, 1.2, dof)
    first = kinematics.forward_kinematics(arm, start)[1][:2]
    path = line(first, first + rng.uniform(-0.3, 0.3, 2), duration=1.0, samples=31)
    free = pk.resolve(arm, path, QP, start=start, limits=FREE, unreachable="track")
    around = np.stack([start - 0.05, start + 0.05])
    limits = Limits(
        position=tuple(np.stack([np.minimum(around[0], 0.6 * free.q.min(axis=0) + 0.4 * start),
                                 np.maximum(around[1], 0.6 * free.q.max(axis=0) + 0.4 * start)])),
        velocity=rng.uniform(0.5, 1.0) * np.abs(free.dq).max(),
        acceleration=rng.uniform(0.5, 2.0) * np.abs(free.ddq).max(),
    )  # fmt: skip
    motion = pk.resolve(arm, path, QP, start=start, limits=limits, unreachable="track")
    assert max(worst_violations(free, limits).values()) > 1e-3
    assert max(worst_violations(motion, limits).values()) < 1e-8
    assert (motion.traces.active != "").any()
    followed = motion.traces.status == "done"
    assert motion.tracking_error[1:][followed].max(initial=0.0) < 2e-12


@pytest.mark.parametrize("acceleration", [np.inf, 60.0])
def test_links_stay_clear_of_obstacles(acceleration):
    limits = Limits(position=12.0, velocity=np.inf, acceleration=acceleration, clearance=0.01)
    beside = {"obstacles": [pk.obstacles.Circle([0.38, 0.14], 0.05)], "link_radius": 0.01}
    assert down(limits, pk.methods.PseudoInverse(), **beside).clearance.min() < -1e-3
    motion = down(limits, unreachable="track", **beside)
    assert motion.clearance.min() == pytest.approx(0.01, abs=1e-9)
    assert max(worst_violations(motion, limits).values()) < 1e-6
    assert "clearance" in motion.traces.active[:, -1]
    followed = motion.traces.status == "done"
    assert followed.all() or np.isfinite(acceleration)  # sometimes braking is too late for the path
    assert motion.tracking_error[1:][followed].max() < 2e-12


def test_limits_that_leave_no_way_on_are_named():
    with pytest.raises(
        Infeasible, match=r"limits leave no velocities .*: upper velocity of joint1 and .* sample \d+ \("
    ) as failure:
        down(Limits(position=12.0, velocity=[0.01, 0.01, 0.01]))
    assert failure.value.motion is not None
    wall = pk.obstacles.Box([0.45, 0.0], [0.03, 0.2])
    with pytest.raises(Infeasible, match=r"clearance between link \d and obstacle 1, a box at sample"):
        pk.resolve(
            tringali_3r(),
            line([0.368, 0.0], [0.468, 0.0], duration=1.0, samples=51),
            QP,
            limits=FREE,
            obstacles=[wall],
        )


@pytest.mark.parametrize("velocity", [0.15, 0.5])
def test_limits_that_damping_keeps_the_step_away_from_are_named_too(velocity):
    arm = pk.Arm.planar(lengths=[0.4, 0.3, 0.25, 0.15], velocity_limits=3.0, position_limits=2.8)
    start = np.array([0.3, 0.6, -0.8, 0.5])
    begin = np.asarray(arm.pose(start).position)[:2]
    path = pk.line(begin, begin + np.array([-0.25, 0.2]), duration=2.0, samples=51)
    limits = pk.Limits(velocity=velocity, acceleration=2.0)
    with pytest.raises(pk.Infeasible) as fault:
        pk.resolve(arm, path, pk.methods.ConstrainedQP(), start=start, limits=limits)
    assert "velocity of joint2" in fault.value.limit


def test_a_joint_past_its_limit_is_refused_or_returns():
    limits = Limits(position=([-3.0, 0.4, -3.0], [3.0, 3.0, 3.0]), velocity=2.0, acceleration=50.0)
    with pytest.raises(InvalidInput, match=r"start: joints must be .* for ConstrainedQP, got joint2 0.073 beyond;"):
        down(limits)
    motion = down(limits, unreachable="track")
    assert motion.q[-1, 1] >= 0.4 - 1e-9
    assert np.abs(motion.dq).max() <= 2.0 + 1e-9
    assert (motion.traces.status[0], motion.traces.active[0, 1]) == ("limited", "lower position")


def test_a_batch_is_resolved_as_its_motions_are():
    limits = Limits(position=([-3, -3, -1.2], [3, 3, 3]), velocity=np.inf)
    starts, gains = START + np.array([[0.0, 0.0, 0.0], [0.01, 0.0, -0.01]]), np.array([0.1, 0.4])

    def resolved(gain, start):
        method = pk.methods.ConstrainedQP(criteria=pk.methods.Criterion(objective=pk.manipulability, gain=gain))
        return pk.resolve(tringali_3r(), DOWN.resample(21), method, start=start, limits=limits)

    together = resolved(gains, starts)
    for i, gain in enumerate(gains):
        alone = resolved(gain, starts[i])
        np.testing.assert_array_equal(together.q[i], alone.q)
        np.testing.assert_array_equal(together[i].traces.active, alone.traces.active)


def test_limits_are_kept_beside_a_singularity_that_nothing_damps():
    path, limits = line([0.4895, 0.0], [0.40, 0.05], duration=1.0, samples=41), Limits(position=12.0, velocity=2.0)
    method = pk.methods.ConstrainedQP(damping=0.0)
    motion = pk.resolve(tringali_3r(), path, method, start=[0.0, 1e-9, 0.0], limits=limits, unreachable="track")
    assert np.abs(motion.traces.velocities).max() <= 2.0 + 1e-8
    assert "limited" in motion.traces.status


# Laws of a step within limits, which solves a quadratic program


SEEDS = range(5)


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
    """Return the step by Lawson & Hanson's least distance programming, with equations as pairs of inequalities."""
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
    distances = gradients, gradients @ beside - 0.1  # satisfied by rates near the free ones
    limits = bounded(np.maximum(np.abs(beside) * 1.05, 0.7 * np.abs(free)), distances=distances)
    step, expected = limited_step(goal, limits), least_distance(goal, limits)
    assert not limits.keep(free, free)
    assert STATUS[step.status] == "done"
    np.testing.assert_allclose(goal.jacobian @ step.rates, goal.task_rates, atol=1e-12)
    assert limits.keep(step.rates, step.free)
    np.testing.assert_allclose(step.rates, expected, atol=1e-7)


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


# Laws of rates that leave enough distance to brake: all limits stay satisfiable


STEPS = 25


def random_limits(rng, *, braking=True):
    spans, accelerations = rng.uniform(0.1, 2.0, (3, 2)), rng.uniform(0.5, 20.0, (3, 2))
    if not braking:
        accelerations[0] = np.inf
    sides, shape = np.array([-1.0, 1.0]), (STEPS, 3, 2)
    return RateLimits(
        position=np.broadcast_to(spans * sides, shape),
        velocity=rng.uniform(0.5, 3.0, (STEPS, 1, 1)) * sides * np.ones(shape),
        acceleration=np.broadcast_to(accelerations * sides, shape),
        steps=rng.uniform(0.01, 0.1, STEPS),
    )


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), braking=st.booleans(), share=st.sampled_from([0.0, 1.0, None]))
def test_any_rates_within_bounds_keep_every_limit_and_leave_others(seed, braking, share):
    rng = np.random.default_rng(seed)
    limits = random_limits(rng, braking=braking)
    q, rates = np.zeros(3), np.zeros(3)
    for k, dt in enumerate(limits.steps):
        bounds = limits.bounds(k, q, rates)
        lower, upper = bounds[..., 0].max(axis=0), bounds[..., 1].min(axis=0)
        assert (lower <= upper + 1e-9).all()
        np.testing.assert_allclose(intersection(bounds), np.stack([lower, upper], axis=-1), atol=1e-9)
        before, rates = rates, lower + (rng.uniform(size=3) if share is None else share) * (upper - lower)
        q = q + dt * rates
        for values, allowed in (
            (q, limits.position[k]),
            (rates, limits.velocity[k]),
            ((rates - before) / dt, limits.acceleration[k]),
        ):
            assert (values >= allowed[:, 0] - 1e-9).all()
            assert (values <= allowed[:, 1] + 1e-9).all()


@pytest.mark.parametrize("slack", [1e-3, 2.0])
def test_the_highest_rate_brakes_just_before_the_limit(slack):
    steps, braking = np.linspace(0.01, 0.05, 200), np.full((200, 1), 3.0)
    braking[0] = 0.0
    rate = highest_rate(np.array([[slack]]), braking, steps)[0]
    rates = np.maximum(rate - np.cumsum(braking[:, 0] * steps), 0.0)
    assert np.sum(rates * steps) == pytest.approx(slack, rel=1e-12)

"""Laws of ``ConstrainedQP``: every limit is kept at every step, and what cannot be done is said."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik import Limits, line
from paretoik.errors import Infeasible, InvalidInput
from paretoik.robot import kinematics
from paretoik.robot.arms import tringali_3r
from paretoik.task.validation import motion_task
from tests.resolution.test_resolve import ARMS, CRITERIA, FEEDBACK, START, begun, every_arm

DOWN = line([0.468, 0.0], [0.368, 0.0], duration=1.0, samples=101)
FREE = Limits(position=12.0, velocity=np.inf)
QP = pk.methods.ConstrainedQP()


def down(limits, method=QP, **settings):
    return pk.resolve(tringali_3r(), DOWN, method, start=START, limits=limits, **settings)


def worst_violations(motion, limits):
    """Return the worst violation of every limit by the library's own account, by name."""
    task = motion_task(
        motion.arm,
        motion.tasks,
        objectives=[pk.joint_travel],
        limits=limits,
        obstacles=motion.obstacles,
        link_radius=motion.link_radius,
    )
    return dict(zip(task.limit_names, task.violations(motion), strict=True))


@every_arm
def test_without_limits_near_it_is_gradient_projection(name):
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


@pytest.mark.parametrize("seed", range(8))
def test_every_limit_is_kept_at_every_step_of_random_arms(seed):
    rng = np.random.default_rng(seed)
    dof = int(rng.integers(3, 7))
    arm = pk.Arm.planar(lengths=rng.uniform(0.2, 0.5, dof), masses=np.ones(dof), centers=np.full(dof, 0.1),
                        inertias=np.full(dof, 0.01))  # fmt: skip
    start = rng.uniform(-1.2, 1.2, dof)
    first = kinematics.forward_kinematics(arm, start)[1][:2]
    path = line(first, first + rng.uniform(-0.3, 0.3, 2), duration=1.0, samples=61)
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
    assert followed.all() or np.isfinite(acceleration)  # that brake too late for the path now and then
    assert motion.tracking_error[1:][followed].max() < 2e-12


def test_spatial_arms_stay_clear_too():
    make, start = ARMS["spatial"]
    arm = make()
    path = begun(arm, start)
    links = pk.resolve(arm, path, QP, start=start, limits=FREE).links
    elbow, way = links[0, 4], links[-1, 4] - links[0, 4]
    ahead = elbow + (np.linalg.norm(way) * 0.5 + 0.03) * way / np.linalg.norm(way)
    limits = Limits(position=12.0, velocity=np.inf, clearance=0.0)
    obstacles = [pk.obstacles.Sphere(ahead, 0.03)]
    blocked = pk.resolve(arm, path, pk.methods.PseudoInverse(), start=start, limits=limits, obstacles=obstacles)
    motion = pk.resolve(arm, path, QP, start=start, limits=limits, obstacles=obstacles)
    assert blocked.clearance.min() < -1e-3
    assert motion.clearance.min() > -1e-9
    assert motion.tracking_error[1:].max() < 2e-12


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
            line([0.368, 0.0], [0.468, 0.0], duration=1.0, samples=101),
            QP,
            limits=FREE,
            obstacles=[wall],
        )


def test_a_joint_past_its_limit_is_refused_or_returns():
    limits = Limits(position=([-3.0, 0.4, -3.0], [3.0, 3.0, 3.0]), velocity=2.0, acceleration=50.0)
    with pytest.raises(InvalidInput, match=r"start: ConstrainedQP wants .* got joint2 0.073 past one"):
        down(limits)
    motion = down(limits, unreachable="track")
    assert motion.q[-1, 1] >= 0.4 - 1e-9
    assert np.abs(motion.dq).max() <= 2.0 + 1e-9
    assert (motion.traces.status[0], motion.traces.active[0, 1]) == ("limited", "lower position")


def test_a_start_in_an_obstacle_is_refused():
    with pytest.raises(InvalidInput, match=r"start: ConstrainedQP wants links 0.01 m clear of obstacles, got -0.0"):
        down(Limits(position=12.0, clearance=0.01), obstacles=[pk.obstacles.Circle([0.2, 0.05], 0.05)])


@pytest.mark.parametrize("limit", ["torque", "power"])
def test_limits_that_rates_say_nothing_of_are_refused(limit):
    with pytest.raises(InvalidInput, match=f"limits: ConstrainedQP keeps position, .* clearance, got {limit}"):
        down(Limits(**{limit: 3.0}))


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ([1.0, 0.0, 1.0], "positive joint_weights wanted, got 0"),
        ([1.0, 1.0], r"joint_weights \(3,\) wanted, got shape"),
    ],
)
def test_joint_weights_that_cannot_be_used_are_refused(weights, message):
    with pytest.raises(InvalidInput, match=message):
        down(FREE, pk.methods.ConstrainedQP(joint_weights=weights))


def test_a_heavier_joint_moves_less():
    plain, heavy = down(FREE), down(FREE, pk.methods.ConstrainedQP(joint_weights=[1.0, 1.0, 50.0]))
    assert np.ptp(heavy.q[:, 2]) < 0.9 * np.ptp(plain.q[:, 2])


def test_a_batch_is_resolved_as_its_motions_are():
    limits = Limits(position=([-3, -3, -1.2], [3, 3, 3]), velocity=np.inf)
    starts, gains = START + np.array([[0.0, 0.0, 0.0], [0.01, 0.0, -0.01]]), np.array([0.1, 0.4])
    together = pk.resolve(
        tringali_3r(),
        DOWN,
        pk.methods.ConstrainedQP(criteria=pk.methods.Criterion(objective=pk.manipulability, gain=gains)),
        start=starts,
        limits=limits,
    )
    for i, gain in enumerate(gains):
        method = pk.methods.ConstrainedQP(criteria=pk.methods.Criterion(objective=pk.manipulability, gain=gain))
        alone = pk.resolve(tringali_3r(), DOWN, method, start=starts[i], limits=limits)
        np.testing.assert_array_equal(together.q[i], alone.q)
        np.testing.assert_array_equal(together[i].traces.active, alone.traces.active)


def test_limits_are_kept_beside_a_singularity_that_nothing_damps():
    path, limits = line([0.4895, 0.0], [0.40, 0.05], duration=1.0, samples=41), Limits(position=12.0, velocity=2.0)
    method = pk.methods.ConstrainedQP(damping=0.0)
    motion = pk.resolve(tringali_3r(), path, method, start=[0.0, 1e-9, 0.0], limits=limits, unreachable="track")
    assert np.abs(motion.traces.velocities).max() <= 2.0 + 1e-8
    assert "limited" in motion.traces.status


def test_limits_may_vary_along_the_path():
    upper = np.linspace(2.5, 0.2, 101)[:, None] * np.ones(3)
    limits = Limits(position=12.0, velocity=(-upper, upper), acceleration=60.0)
    motion = down(limits, unreachable="track")
    assert max(worst_violations(motion, limits).values()) < 1e-8
    assert "lower velocity" in motion.traces.active


@pytest.mark.parametrize("samples", [3, 9, 31])
def test_a_step_that_is_done_ends_on_the_path_and_one_that_newtons_method_misses_it_by_is_said_to(samples):
    arm = pk.Arm.from_urdf("problems/robots/panda.urdf", base="panda_link0", tip="panda_hand_tcp")
    start = np.array([2.2, -1.2, -2.8, -2.8, 0.14, 2.2, 1.9])
    path = line(kinematics.forward_kinematics(arm, start)[1], [-0.11, -0.30, 0.53], duration=3.0, samples=samples)
    limits = Limits(position=np.full(7, 12.0), velocity=np.inf)
    motion = pk.resolve(arm, path, QP, start=start, limits=limits, unreachable="track")
    ended = motion.tracking_error[1:] < 2e-12
    assert (ended == (motion.traces.status == "done")).all()
    assert (motion.traces.status[0] == "missed") == (samples == 3)

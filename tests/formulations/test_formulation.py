"""pymoo's own algorithms, without options, find feasible points of every formulation with limits."""

from functools import cache

import numpy as np
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.moo.spea2 import SPEA2
from pymoo.optimize import minimize

import paretoik as pk
from paretoik.robot.kinematics import forward_kinematics, link_nodes
from tests.formulations.problems import random_arm

SEEDS = [0, pytest.param(1, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.slow)]


def planar_arm(rng, links):
    """Return a planar arm with random links under gravity."""
    lengths = rng.uniform(0.3, 0.8, links)
    masses = rng.uniform(0.2, 1.0, links)
    arm = pk.Arm.planar(lengths=lengths, masses=masses, centers=lengths / 2, inertias=masses * lengths**2 / 12)
    return arm.mounted(gravity=[0.0, -9.81, 0.0])


def small_arm(seed):
    """Return a random planar or spatial arm of 3 to 5 joints, a posture, and its random number generator."""
    rng = np.random.default_rng(seed)
    arm = random_arm(seed, 5) if seed % 2 else planar_arm(rng, 3 + seed % 4 // 2)
    return arm, rng.uniform(0.3, 1.2, arm.dof) * rng.choice([-1, 1], arm.dof), rng


def straight(arm, q, rng, *, length=0.15, samples=15, duration=1.0):
    """Return a line from the tool's place in a posture, towards the base and to a side."""
    size = 2 if arm.is_planar else 3
    place, way = forward_kinematics(arm, q)[1][:size], rng.normal(size=size)
    way = way / np.linalg.norm(way) - place / np.linalg.norm(place)
    return pk.line(place, place + length * way / np.linalg.norm(way), duration=duration, samples=samples)


def around(arm, q, distance):
    """Return a ball or disc at a distance from the axis of the longest link, at its middle."""
    nodes = link_nodes(arm, q)
    longest = np.linalg.norm(np.diff(nodes, axis=0), axis=1).argmax()
    first, last = nodes[longest : longest + 2]
    across = np.cross(last - first, [0.0, 0.0, 1.0] if arm.is_planar else np.eye(3)[np.abs(last - first).argmin()])
    center, radius = (first + last) / 2 + (distance + 0.05) * across / np.linalg.norm(across), 0.05
    return pk.obstacles.Circle(center[:2], radius) if arm.is_planar else pk.obstacles.Sphere(center, radius)


@cache
def tracking(seed):
    """Return a tracking problem with position and velocity limits just wider than the best roll-out needs."""
    arm, q, rng = small_arm(seed)
    path = straight(arm, q, rng)
    best = pk.plan(pk.Tracking(arm, path, objectives=[pk.peak_velocity]), starts=6, observe=False).best.motion
    limits = pk.Limits(
        position=(best.q.min(axis=0) - 0.2, best.q.max(axis=0) + 0.2),
        velocity=1.3 * np.abs(best.dq).max(axis=0) + 0.1,
    )
    return pk.Tracking(arm, path, objectives=[pk.joint_travel, pk.peak_velocity], limits=limits)


@pk.constraint(unit="rad", lower=0.0)
def bent(motion):
    return np.abs(motion.q[..., 1])


@pk.objective(unit="N m", form="peak")
def holding_torque(motion):
    return np.abs(motion.torque).max(axis=-1)


def motors(rng, arm):
    reach = link_nodes(arm, np.zeros(arm.dof))
    load = 9.81 * sum(body.mass for body in arm.bodies) * np.linalg.norm(np.diff(reach, axis=0), axis=1).sum()
    curve = pk.capability.MotorCurve(stall=np.full(arm.dof, 1.2 * load), fastest=rng.uniform(1.0, 3.0, arm.dof))
    return pk.capability.JointActuation(motors=curve)


def reach(seed):
    rng = np.random.default_rng(seed)
    arm = planar_arm(rng, 3)
    places = [forward_kinematics(arm, rng.uniform(0.3, 1.0, 3))[1][:2] for _ in range(2)]
    return pk.PointToPoint(
        arm, motors(rng, arm), *places, samples=9, coefficients=4, bases=4, constraints=[bent], seed=seed
    )


def two_ways(seed):
    rng = np.random.default_rng(seed)
    arm = planar_arm(rng, 3)
    place = forward_kinematics(arm, rng.uniform(0.3, 1.0, 3))[1][:2]
    return pk.DirectionalMaxima(arm, motors(rng, arm), place, np.eye(2), constraints=[bent], starts=60, seed=seed)


def standing(seed):
    """Return a posture search with limited holding torques and an obstacle near the place."""
    arm, q, rng = small_arm(2 * seed)
    motion = pk.Motion(arm=arm, time=np.arange(3.0), q=np.tile(q, (3, 1)))
    limits = pk.Limits(torque=np.abs(motion.torque[0]) + 0.3 * np.abs(motion.torque[0]).max())
    return pk.Posture(
        arm, straight(arm, q, rng), limits=limits, objectives=[holding_torque], obstacles=[around(arm, q, 0.05)]
    )


def tuning(seed):
    arm, q, rng = small_arm(seed)
    method = pk.methods.DampedLeastSquares() if seed % 2 else pk.methods.GradientProjection(criteria=pk.manipulability)
    return pk.Tuning(arm, straight(arm, q, rng), method, starts=q[None], tolerance=0.02)


def control_step(seed):
    arm, q, rng = small_arm(seed)
    place = straight(arm, q, rng).positions[0]
    path = pk.line(place, place + rng.normal(0.0, 1e-3, len(place)), duration=0.02, samples=3)
    return pk.ControlStep(arm, path, q, home=q - 0.1, obstacles=[around(arm, q, 0.02)], longest_step=0.05)


FORMULATIONS = {
    "tracking": tracking,
    "point to point": reach,
    "directional maxima": two_ways,
    "posture": standing,
    "tuning": tuning,
    "control step": control_step,
}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", FORMULATIONS)
def test_nsga2_without_options_finds_feasible_points(name, seed):
    problem = FORMULATIONS[name](seed)
    result = minimize(problem, NSGA2(pop_size=20), ("n_gen", 30), seed=seed)
    assert result.F is not None
    F, G = problem.evaluate(np.atleast_2d(result.X), return_values_of=["F", "G"])
    assert (G <= 0).all()
    np.testing.assert_allclose(F, np.atleast_2d(result.F), rtol=1e-9)  # individuals have the genes that were evaluated


def first_generation(problem, algorithm, seed=1):
    return minimize(problem, algorithm, ("n_gen", 1), seed=seed).pop.get("X")


@pytest.mark.parametrize("algorithm", [NSGA2, SPEA2])
def test_the_first_generation_is_the_problems_own_and_comes_from_the_seed(algorithm):
    problem = FORMULATIONS["tracking"](0)
    first, again, other = (first_generation(problem, algorithm(pop_size=12), seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    starts = problem.sample_starts(4, np.random.default_rng(0))
    assert all((np.abs(first - start).max(axis=1) == 0).any() for start in starts)


def test_a_sampling_of_the_users_own_is_kept():
    problem = FORMULATIONS["tracking"](0)
    genes = np.random.default_rng(0).uniform(problem.xl, problem.xu, (12, problem.n_var))
    kept = first_generation(problem, NSGA2(pop_size=12, sampling=genes))
    np.testing.assert_array_equal(kept[np.lexsort(kept.T)], genes[np.lexsort(genes.T)])
    given = first_generation(problem, NSGA2(pop_size=12, sampling=problem.sampling()))
    starts = problem.sample_starts(4, np.random.default_rng(0))
    assert all((np.abs(given - start).max(axis=1) == 0).any() for start in starts)

"""The largest violation between samples: no finer grid finds more, and little less is there."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.robot.dynamics import inverse_dynamics
from paretoik.task.motion_task import divide, largest_between
from paretoik.trajectory.plan_starts import sample_starts
from problems import panda

TOLERANCE = 1e-9  # share of a limit's range


@pytest.mark.parametrize("seed", range(20))
def test_no_grid_finds_more_than_the_bound_of_waves_with_kinks(seed):
    rng = np.random.default_rng(seed)
    sizes, rates, phases = rng.normal(size=(3, 4, 6)) * np.array([1.0, 12.0, 3.0])[:, None, None]
    corners, slopes = rng.uniform(size=4), rng.uniform(0, 20, size=4)

    def columns(times):
        waves = np.sum(sizes * np.sin(rates * times[..., None, None] + phases), axis=-1)
        return waves - slopes * np.abs(times[..., None] - corners)

    knots = np.sort(np.append(rng.uniform(size=9), [0.0, 1.0]))
    bound = largest_between(columns, divide(knots))
    dense = columns(np.append(np.linspace(0, 1, 100_001), corners)).max(initial=0.0)
    assert dense - TOLERANCE <= bound <= 1.002 * dense + 1e-6


def test_a_value_that_is_none_is_no_bound():
    assert np.isnan(
        largest_between(lambda times: np.where(times > 0.5, np.nan, 0.0)[..., None], divide(np.arange(4.0)))
    )


@pk.constraint(unit="m", lower=0.05)
def height(motion):
    return np.abs(motion.tool[..., 1])


@pk.constraint(unit="rad", upper=1.0, form="terminal")
def at_the_end(motion):
    return motion.q[..., -1, 0] - motion.q[..., 0, 0]


def planar(rng):
    lengths = rng.uniform(0.15, 0.25, 4)
    arm = pk.Arm.planar(lengths=lengths, masses=np.ones(4), centers=lengths / 2, inertias=lengths**2 / 12)
    middle, across = np.array([0.4, 0.1]), rng.uniform(-0.1, 0.1, 2)
    if rng.random() < 0.5:
        return arm, pk.circle(middle, 0.07, duration=1.0, samples=13), True
    return arm, pk.line(middle - across, middle + across, duration=1.0, samples=13), False


def spatial(rng):
    middle, across = np.array([0.45, 0.0, 0.4]), rng.uniform(-0.15, 0.15, 3)
    ends = [pk.Pose.from_rpy(tuple(end), panda.DOWN) for end in (middle - across, middle + across)]
    return panda.panda(), pk.line(*ends, duration=1.5, samples=11), False


def rough_problem(rng, arm, path, cyclic, **settings):
    """Return a task whose limits its random motions violate, of every kind, some varying, and motions."""
    free = pk.Limits(position=np.inf, velocity=np.inf, torque=np.inf)
    task = pk.Tracking(arm, path, objectives=[pk.kinetic_energy], limits=free, cyclic=cyclic, **settings).task
    q = sample_starts(task, 2, rng)
    motions = task.motion(q)
    share, samples = rng.uniform(0.9, 1.1, size=5), len(path.times)
    varying = rng.uniform(0.9, 1.1, size=(samples, arm.dof))
    limits = pk.Limits(
        position=(motions.q.min(axis=(0, 1)) - 0.01 * share[0], motions.q.max(axis=(0, 1)) + 0.01),
        velocity=varying * np.abs(motions.dq).max(axis=(0, 1)),
        acceleration=share[1] * np.abs(motions.ddq).max(axis=(0, 1)),
        torque=share[2] * np.abs(motions.torque).max(axis=(0, 1)) + 1e-6,
        power=share[3] * np.abs(motions.power).max(axis=(0, 1)) + 1e-6,
        clearance=0.02,
    )
    node = motions.links[0, len(path.times) // 2, 2]
    place = node + 0.08 * rng.normal(size=3) * (1, 1, 0 if arm.is_planar else 1)
    ball = pk.obstacles.Circle(place[:2], 0.03) if arm.is_planar else pk.obstacles.Sphere(place, 0.03)
    problem = pk.Tracking(
        arm,
        path,
        objectives=[pk.kinetic_energy],
        limits=limits,
        constraints=[height, at_the_end],
        obstacles=[ball],
        cyclic=cyclic,
        **settings,
    )
    return problem.task, q


def found_on_a_grid(task, motion, finer=200):
    """Return the largest violation at times 200 times finer than the samples, from states alone."""
    t = np.append((task.times[:-1, None] + np.diff(task.times)[:, None] * np.arange(finer) / finer).ravel(), 0)
    t[-1] = task.times[-1]
    state = motion.state(t)
    values = {"position": state.q, "velocity": state.dq, "acceleration": state.ddq}
    torque = inverse_dynamics(task.arm, *state)
    values |= {"torque": torque, "power": torque * state.dq}
    worst = [0.0]
    for kind, bounds in task.bounds.items():
        low, high = (
            np.stack(
                [np.interp(t, task.times, side) for side in np.broadcast_to(part, (len(task.times), task.arm.dof)).T]
            )
            for part in (bounds[..., 0], bounds[..., 1])
        )
        worst.append(float((np.maximum(values[kind].T - high, low - values[kind].T) / (high - low)).max()))
    return worst


@pytest.mark.parametrize("differences", ["spline", "backward"])
@pytest.mark.parametrize("made", [planar, spatial])
@pytest.mark.parametrize("seed", range(3))
def test_no_finer_grid_finds_a_larger_violation(made, seed, differences):
    rng = np.random.default_rng(seed)
    task, q = rough_problem(rng, *made(rng), differences=differences)
    motions = task.motion(q)
    for motion, stated in zip(motions, task.violation_between(motions), strict=True):
        assert stated >= max(found_on_a_grid(task, motion)) - TOLERANCE


def test_a_limit_that_ends_is_judged_while_there_is_one():
    arm, path, _ = planar(np.random.default_rng(1))
    velocity = np.full((13, 4), 0.1)
    velocity[5:] = np.inf
    task, always = (
        pk.Tracking(arm, path, objectives=[pk.kinetic_energy], limits=pk.Limits(velocity=each)).task
        for each in (velocity, 0.1)
    )
    motions = task.motion(sample_starts(always, 1, np.random.default_rng(0)))
    assert 0 < task.violation_between(motions)[0] <= always.violation_between(motions)[0] < np.inf

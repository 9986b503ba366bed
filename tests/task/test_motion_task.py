"""Motion tasks: their parts, and the limits that they name."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik import Limits, line
from paretoik.collision.obstacles import Circle
from paretoik.errors import EvaluationFailed
from paretoik.robot.dynamics import inverse_dynamics
from paretoik.task.motion_task import divide, evaluate_motions, examine_functions, largest_between, require_values
from paretoik.task.random_starts import rollout_starts
from paretoik.trajectory.plan_starts import sample_starts
from problems import panda
from tests.task.tasks import task


def test_limits_that_vary_are_linear_between_the_samples_of_other_paths():
    velocity = np.linspace(1.0, 3.0, 21)[:, None] * np.ones(3)
    velocity[:5, 1] = np.inf
    coarse = task(limits=Limits(velocity=velocity))
    finer = coarse.with_midpoints()
    np.testing.assert_array_equal(finer.bounds["velocity"][::2], coarse.bounds["velocity"])
    upper = finer.bounds["velocity"][..., 1]
    np.testing.assert_allclose(upper[:, 0], np.linspace(1.0, 3.0, 41))
    assert np.isinf(upper[:10, 1]).all()
    np.testing.assert_allclose(upper[10:, 1], np.linspace(1.5, 3.0, 31))
    for other in (finer.subsample(21), finer.resample(21)):
        np.testing.assert_allclose(other.bounds["velocity"], coarse.bounds["velocity"])


def test_violations_are_the_worst_of_every_limit():
    @pk.constraint(unit="m", lower=0.05, upper=0.25)
    def height(motion):
        return motion.tool[..., 1]

    post = Circle([0.3, 0.3], 0.1)
    limits = Limits(position=(-1.0, [1.0, np.inf, 2.0]), velocity=3.0, clearance=0.02)
    result = task(limits=limits, obstacles=[post], link_radius=0.01, constraints=[height])
    motions = result.motion(np.random.default_rng(0).normal(size=(5, 21, 3)))
    columns = dict(zip(result.limit_names, result.violations(motions).T, strict=True))
    q, v = motions.q, motions.dq
    np.testing.assert_allclose(columns["position of joint1"], np.maximum(q[..., 0] - 1, -1 - q[..., 0]).max(axis=1) / 2)
    np.testing.assert_allclose(columns["position of joint2"], (-1 - q[..., 1]).max(axis=1))
    np.testing.assert_allclose(columns["velocity of joint3"], (np.abs(v[..., 2]).max(axis=1) - 3) / 6)
    np.testing.assert_allclose(columns["clearance"], (0.02 - motions.clearance.min(axis=1)) / 0.02)
    y = motions.tool[..., 1]
    np.testing.assert_allclose(columns["height"], np.maximum(y - 0.25, 0.05 - y).max(axis=1) / 0.2)
    np.testing.assert_allclose(result.violations(motions[3]), result.violations(motions)[3], rtol=1e-12)


def test_the_binding_limit_is_told_with_joint_share_sample_and_time():
    result = task(limits=Limits(position=1.0, velocity=50.0))
    q = np.zeros((21, 3))
    assert result.describe_violation(result.motion(q)) == ""
    q[5, 1] = 1.5
    assert (
        result.describe_violation(result.motion(q))
        == "position of joint2 is above its upper limit by 25 % of its range at sample 5 (0.25 s)"
    )
    q[5, 1] = 1.5 + 1e-9
    q[11, 2] = -9.0
    message = result.describe_violation(result.motion(q))
    assert message == "position of joint3 is below its lower limit by 400 % of its range at sample 11 (0.55 s)"


def test_a_motion_that_leaves_its_path_between_samples_is_infinitely_off_and_no_other():
    """If the first joint makes a whole turn between two samples, the curve leaves the path."""
    limited = task(limits=Limits(velocity=2.0), path=line([0.35, 0.0], [0.3, 0.1], duration=1.0, samples=11))
    (smooth,) = rollout_starts(limited, 1, np.random.default_rng(0))
    turning = smooth + 2 * np.pi * np.outer(np.arange(11) % 2, [1.0, 0.0, 0.0])
    alone = limited.violation_between(limited.motion(smooth[None]))
    both = limited.violation_between(limited.motion(np.stack([smooth, turning])))
    np.testing.assert_array_equal(both, [alone[0], np.inf])


# The largest violation between samples, compared with finer grids


TOLERANCE = 1e-9  # share of a limit's range


@pytest.mark.parametrize("seed", range(3))
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
    """Return random motions and a task whose limits of every kind, some varying, they violate."""
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


@pytest.mark.parametrize(
    ("made", "seed", "differences"), [(planar, 0, "spline"), (planar, 1, "backward"), (spatial, 2, "spline")]
)
def test_no_finer_grid_finds_a_larger_violation(made, seed, differences):
    rng = np.random.default_rng(seed)
    task, q = rough_problem(rng, *made(rng), differences=differences)
    motions = task.motion(q)
    for motion, stated in zip(motions, task.violation_between(motions), strict=True):
        assert stated >= max(found_on_a_grid(task, motion)) - TOLERANCE


# Failures in the evaluation of motions, and useless objectives


CHANCE = np.random.default_rng(0)


@pytest.fixture(scope="module")
def rollouts():
    return rollout_starts(task(), 40, np.random.default_rng(0))


def test_a_function_that_fails_for_one_motion_fails_it_alone(rollouts):
    @pk.objective(unit="rad", form="terminal")
    def picky(motion):
        if np.any(motion.q[..., -1, 0] > 0.3):
            raise ZeroDivisionError("over 0.3")
        return motion.q[..., -1, 0]

    fussy = task(objectives=[pk.kinetic_energy, picky])
    F, _, causes = evaluate_motions(fussy, fussy.motion(rollouts))
    failing = rollouts[:, -1, 0] > 0.3
    assert 0 < failing.sum() < len(rollouts)
    np.testing.assert_array_equal(np.isnan(F[:, 1]), failing)
    assert np.isfinite(F[:, 0]).all()
    assert [cause == "objective picky raised ZeroDivisionError: over 0.3" for cause in causes] == failing.tolist()
    require_values(fussy, fussy.motion(rollouts))
    with pytest.raises(EvaluationFailed, match="every evaluation failed, the first with: objective picky raised"):
        require_values(fussy, fussy.motion(rollouts[failing]))


def objective_of(function):
    return pk.objective(unit="rad", form="terminal", name="odd", maximise=True)(function)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (
            lambda motion: np.full(len(motion.q), 3.0),
            "objective odd must vary, got 3 for each of the first 40 arguments: it may be",
        ),
        (
            lambda motion: CHANCE.random(len(motion.q)),
            r"objective odd must have the same value for the same argument, got 0\.6369\d* and then 0\.",
        ),
    ],
)
def test_objectives_that_are_constant_or_a_matter_of_chance_are_noticed(rollouts, function, words):
    odd = task(objectives=[pk.kinetic_energy, objective_of(function)])
    with pytest.warns(RuntimeWarning, match=words) as warned:
        examine_functions(odd, odd.motion(rollouts))
    assert len(warned) == 1

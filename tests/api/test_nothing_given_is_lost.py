"""Solutions given to a verb as ``initial`` are never lost: no result is worse than the best of them."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.task.random_starts import perturbed_starts, rollout_starts
from paretoik.trajectory.plan_starts import sample_starts

FEASIBLE = 1e-8
ROUNDING = 1e-12


def planar(joints, seed):
    """A planar arm with random links."""
    rng = np.random.default_rng(seed)
    lengths, masses = rng.uniform(0.2, 0.5, joints), rng.uniform(0.3, 2.0, joints)
    return pk.Arm.planar(
        lengths=lengths, masses=masses, centers=lengths / 2, inertias=masses * lengths**2 / 12, position_limits=2.8
    )


def spatial(seed):
    """A spatial 5R arm with random links."""
    rng = np.random.default_rng(seed)
    a, masses = rng.uniform(0.15, 0.3, 5), np.linspace(2.0, 0.5, 5)
    return pk.Arm.from_dh(
        a=a,
        alpha=np.array([1, -1, 1, -1, 1]) * np.pi / 2,
        d=rng.uniform(0.0, 0.2, 5),
        theta=np.zeros(5),
        masses=masses,
        centers=-0.5 * np.stack([a, 0 * a, 0 * a], axis=1),
        inertias=[np.eye(3) * m * 0.01 for m in masses],
        convention="standard",
    )


def drawn(seed, *, joints=3, cyclic=False, objectives=(pk.kinetic_energy,), samples=51):
    """A problem with an arm and a path near the tool position of a random posture."""
    arm, rng = (planar(joints, seed) if joints else spatial(seed)), np.random.default_rng(seed + 99)
    for _ in range(50):
        place = tool_of(arm, rng)
        try:
            if cyclic:
                path = pk.circle(place, 0.15, duration=1.0, samples=samples)
            else:
                path = pk.line(place, place + rng.normal(scale=0.2, size=len(place)), duration=1.0, samples=samples)
            return pk.Tracking(arm, path, objectives=list(objectives), cyclic=cyclic, bases=2, differences="backward")
        except pk.ParetoikError:
            continue
    raise AssertionError("no path within reach")


def tool_of(arm, rng):
    """The tool position of a random posture."""
    from paretoik.robot.kinematics import forward_kinematics

    position = forward_kinematics(arm, rng.uniform(-1.5, 1.5, arm.dof))[1]
    return position[:2] if arm.is_planar else position


def known_motions(problem, seed, count=3):
    """Motions that follow the path, some of them perturbed."""
    rng = np.random.default_rng(seed)
    q = rollout_starts(problem.task, 12, rng)
    shaken = perturbed_starts(problem.task, q, rng)
    return problem.task.motion(np.concatenate([q[: count - 1], shaken[:1]]))


def feasible_values(problem, motions):
    """Minimised objectives of the motions that satisfy all limits."""
    motions = motions if motions.q.ndim == 3 else motions[None]
    keeps = problem.task.violations(motions).max(axis=1, initial=0.0) <= FEASIBLE
    values = np.stack([o(motions) * o.sign for o in problem.task.objectives], axis=1)
    return values[keeps]


def assert_not_dominated(front, values):
    """No feasible given point dominates a returned one, up to 1e-9 of a range."""
    slack = 1e-9 * np.maximum(np.ptp(front.minimised, axis=0), np.abs(values).max(axis=0))
    for point in front.minimised:
        better = (values <= point).all(axis=1) & (values < point - slack).any(axis=1)
        assert not better.any(), (point, values[better])


@pytest.mark.parametrize(
    ("joints", "cyclic", "seed"),
    [
        (3, False, 0),
        (4, True, 1),
        (0, False, 2),
        *(
            pytest.param(joints, cyclic, seed, marks=pytest.mark.slow)
            for joints in (3, 4, 0)
            for cyclic in (False, True)
            for seed in (3, 4, 5)
        ),
    ],
)
def test_a_plan_is_no_worse_than_what_it_was_given(joints, cyclic, seed):
    problem = drawn(seed, joints=joints, cyclic=cyclic, samples=31)
    motions = known_motions(problem, seed)
    planned = pk.plan(problem, starts=1, seed=seed, initial=motions)
    assert planned.best.objective <= feasible_values(problem, motions).min(initial=np.inf) * (1 + ROUNDING)
    again = pk.plan(problem, starts=1, seed=seed + 1, initial=planned.best.motion)
    assert again.best.objective <= planned.best.objective * (1 + ROUNDING)
    assert again.best.status == "converged"


@pytest.mark.parametrize("joints", [3, pytest.param(0, marks=pytest.mark.slow)])
def test_no_given_point_dominates_a_front_of_epsilon_constraints(joints):
    problem = drawn(2, joints=joints, objectives=[pk.kinetic_energy, pk.torque_norm], samples=16)
    rng = np.random.default_rng(0)
    motions = problem.task.motion(sample_starts(problem.task, 6, rng))
    front = pk.epsilon_front(problem, points=3, starts=1, initial=motions)
    assert_not_dominated(front, feasible_values(problem, motions))
    again = pk.epsilon_front(problem, points=4, starts=1, seed=7, initial=front)
    assert_not_dominated(again, front.minimised)


@pytest.mark.parametrize("objectives", [[pk.kinetic_energy], [pk.kinetic_energy, pk.torque_norm, pk.joint_travel]])
@pytest.mark.parametrize("joints", [3, pytest.param(0, marks=pytest.mark.slow)])
def test_no_given_point_dominates_a_front_that_was_searched_for(joints, objectives):
    problem = drawn(3, joints=joints, objectives=objectives, samples=16)
    motions = problem.task.motion(sample_starts(problem.task, 4, np.random.default_rng(0)))
    with pytest.warns(RuntimeWarning, match="approximately"):
        front = pk.solve(problem, population=12, generations=2, initial=motions)
    assert_not_dominated(front, feasible_values(problem, motions))


@pytest.mark.parametrize("joints", [3, pytest.param(0, marks=pytest.mark.slow)])
def test_no_point_dominates_its_refined_point(joints):
    problem = drawn(4, joints=joints, objectives=[pk.kinetic_energy, pk.torque_norm], samples=16)
    front = pk.solve(problem, population=12, generations=3)
    refined = pk.refine(front)
    assert_not_dominated(refined, front.minimised)
    assert_not_dominated(pk.refine(refined), refined.minimised)

"""Refusals are never false, quick if clear, and name the user's sample, the limit, the joint or the obstacle."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
from scipy.optimize import linprog

import paretoik as pk
from paretoik.collision.obstacles import clearance
from paretoik.robot.dynamics import gravity_torques
from paretoik.robot.kinematics import link_nodes
from paretoik.trajectory.infeasibility import no_posture_keeps_limits
from problems import panda, tringali_2020
from tests.api.problems import PATH
from tests.robot.planar_postures import all_postures

POSITION = np.deg2rad([90, 120, 120])


def refusal(*, samples=101, objective=pk.kinetic_energy, **settings):
    """Return the error of a plan of a line."""
    path = tringali_2020.straight(samples)
    settings = {"differences": "backward", **settings}
    problem = pk.Tracking(pk.arms.tringali_3r(), path, objectives=[objective], **settings)
    with pytest.raises(pk.Infeasible) as raised:
        pk.plan(problem, starts=8)
    return raised.value


@pytest.mark.parametrize(("limits", "limit"), [({"position": 0.35}, "position"), ({"velocity": 1.0}, "velocity")])
def test_limits_that_clearly_contradict_the_path_are_named_by_joint_and_sample_of_the_users(limits, limit):
    error = refusal(limits=pk.Limits(**limits))
    assert error.limit.startswith(f"{limit} of joint")
    assert re.search(r"at sample \d+", str(error))
    for sample, time in re.findall(r"at sample (\d+) \(([\d.]+) s\)", str(error)):
        assert int(sample) == round(100 * float(time))
    assert len(error.motion.q) == 101
    assert re.search(r"; it may help: (a longer duration|another place of the path)", str(error))


def test_an_obstacle_on_the_path_is_blamed_by_number_and_link():
    with pytest.warns(RuntimeWarning, match=r"path: obstacle 2, a circle, is in its way: at sample \d+ .* link 3"):
        error = refusal(
            limits=pk.Limits(position=POSITION),
            obstacles=[pk.obstacles.Circle([1.0, 1.0], 0.1), pk.obstacles.Circle([0.3, 0.07], 0.03)],
        )
    assert error.limit == "clearance"
    assert "between link 3 and obstacle 2, a circle" in str(error)
    assert re.search(
        r"no motion can satisfy the limits \(proved: no posture at sample \d+, [\d.]+ s, satisfies them\)", str(error)
    )
    assert re.search(
        r"; none of \d+ postures tried at sample \d+ satisfies the limits; it may help: obstacles", str(error)
    )


def test_an_arm_without_masses_serves_kinematics_and_refuses_dynamics_by_name():
    arm, path = pk.Arm.planar(lengths=[0.3, 0.3, 0.2], name="bare"), tringali_2020.straight(8)
    planned = pk.plan(pk.Tracking(arm, path, objectives=[_effort], differences="backward"), starts=4)
    assert planned.best.status == "converged"
    for objective in (pk.kinetic_energy, pk.torque_norm, pk.peak_torque):
        with pytest.raises(pk.InvalidInput, match=f"objective {objective.name}: the arm must have masses, got bare"):
            pk.Tracking(arm, path, objectives=[objective], differences="backward")
    with pytest.raises(pk.InvalidInput, match="torque limit: the arm must have masses, got bare, which has"):
        pk.Tracking(arm, path, objectives=[_effort], limits=pk.Limits(torque=1.0), differences="backward")


@pk.objective(unit="rad²/s", form="integral")
def _effort(motion):
    return np.sum(motion.dq**2, axis=-1)


def feasible_problem(seed, *, arm, plane, samples=41):
    """Return a feasible problem, and a motion that satisfies its limits by 2 % of their ranges."""
    rng = np.random.default_rng(seed)
    lower, upper = np.where(np.isfinite(arm.position_limits.T), arm.position_limits.T, [[-2.2], [2.2]])
    t = np.linspace(0.0, float(rng.uniform(0.8, 2.0)), samples)
    swings = rng.uniform(-0.6, 0.6, (3, arm.dof)) * np.array([[1.0], [0.4], [0.2]])
    q = rng.uniform(0.7 * lower + 0.3 * upper, 0.3 * lower + 0.7 * upper)
    q = q + sum(swing * (1 - np.cos(np.pi * (k + 1) * t / t[-1]))[:, None] / 2 for k, swing in enumerate(swings))
    q = np.clip(q, lower, upper)
    poses = arm.pose(q)
    path = pk.poses(t, poses.position[:, :2]) if plane else pk.Task(pk.poses(t, poses), axes="xyz+z-axis")
    differences = str(rng.choice(["spline", "backward"]))
    settings = {"objectives": [pk.kinetic_energy], "differences": differences, "link_radius": 0.02, "bases": 1}
    free = pk.Limits(position=np.inf, velocity=np.inf, torque=np.inf)
    motion = pk.Tracking(arm, path, limits=free, **settings).task.motion(q).instants
    speeds = motion.dq if motion.derivatives is None else motion.derivatives.velocity_bounds
    slack = 0.02 * np.maximum(np.ptp(motion.q, axis=0), 0.02)
    every = {
        "position": (motion.q.min(axis=0) - slack, motion.q.max(axis=0) + slack),
        "velocity": 1.02 * np.abs(speeds).max(axis=0),
        "acceleration": 1.02 * np.abs(motion.ddq).max(axis=0),
        "torque": 1.02 * np.abs(motion.torque).max(axis=0),
    }
    limits = {kind: value if rng.random() < 0.6 else np.inf for kind, value in every.items()}
    nodes, obstacles = link_nodes(arm, motion.q), []
    for _ in range(20):
        center = nodes[rng.integers(len(nodes)), rng.integers(1, nodes.shape[1])] + 0.2 * rng.normal(size=3)
        obstacle = pk.obstacles.Circle(center[:2], 0.08) if plane else pk.obstacles.Sphere(center, 0.08)
        if len(obstacles) < 2 and clearance([obstacle], nodes, 0.02).min() > 0.01:
            obstacles.append(obstacle)
    problem = pk.Tracking(arm, path, limits=pk.Limits(**limits), obstacles=obstacles, **settings)
    assert problem.task.violations(problem.task.motion(q)).max(initial=0.0) <= 0
    return problem


def planar_arm(seed):
    rng = np.random.default_rng(seed)
    lengths, masses = rng.uniform(0.15, 0.5, (joints := int(rng.integers(3, 6)))), rng.uniform(0.3, 2.0, joints)
    arm = pk.Arm.planar(lengths=lengths, masses=masses, centers=lengths / 2, inertias=masses * lengths**2 / 12)
    return arm.mounted(gravity=(0.0, -9.81, 0.0)) if rng.random() < 0.5 else arm


@pytest.mark.filterwarnings("ignore:poses. samples")  # some of these curves run backwards between samples
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 60))])
def test_no_feasible_problem_in_the_plane_is_refused(seed):
    problem = feasible_problem(seed, arm=planar_arm(seed), plane=True)
    problem.require_feasible()
    assert not any(no_posture_keeps_limits(problem.task, sample) for sample in (10, 40))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_no_feasible_problem_in_space_is_refused(seed):
    problem = feasible_problem(seed, arm=panda.panda(), plane=False)
    problem.require_feasible()


LENGTHS = 0.176, 0.176, 0.1375  # m, of the paper's arm


def test_a_posture_is_proved_impossible_if_and_only_if_closed_form_postures_break_the_limits():
    arm, path = pk.arms.tringali_3r(), tringali_2020.straight(26)
    angles, verdicts = np.linspace(-np.pi, np.pi, 2000, endpoint=False), []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        limits = pk.Limits(position=rng.uniform(0.8, 2.2, 3), velocity=np.inf)
        obstacle = pk.obstacles.Circle(rng.uniform([0.05, 0.05], [0.4, 0.3]), rng.uniform(0.02, 0.05))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                task = pk.Tracking(
                    arm, path, objectives=[pk.kinetic_energy], limits=limits, obstacles=[obstacle], bases=1
                ).task
            except pk.InvalidInput:  # it overlaps the base
                continue
        sample = int(rng.integers(26))
        q = all_postures(LENGTHS, path.positions[sample], angles)
        distance = clearance([obstacle], link_nodes(arm, q)) / 0.01
        margin = np.minimum((limits.position - np.abs(q)).min(axis=1), distance).max()
        proved = no_posture_keeps_limits(task, sample)
        verdicts.append(proved)
        assert proved or margin > -0.01  # at the latest that far from any posture
        assert not (proved and margin > 0)
    assert 2 < sum(verdicts) < len(verdicts) - 2


def test_speeds_are_proved_impossible_only_if_linear_programs_of_all_postures_say_so():
    arm, path = pk.arms.tringali_3r(), tringali_2020.straight(101)
    sample = 50
    velocity = path.rates(path.times[[sample]]).velocity[0]
    q = all_postures(LENGTHS, path.positions[sample], np.linspace(-np.pi, np.pi, 120, endpoint=False))
    needed = min(least_speed(arm.jacobian(each)[:2], velocity) for each in q)
    proved = []
    for share in (0.5, 0.8, 1.02):
        limits = pk.Limits(velocity=share * needed)
        task = pk.Tracking(arm, path, objectives=[pk.kinetic_energy], limits=limits, bases=1).task
        proved.append(no_posture_keeps_limits(task, sample))
    assert proved == [True, True, False]


def least_speed(jacobian, velocity):
    """Return the least maximum joint speed that gives the tool a velocity."""
    joints = jacobian.shape[1]
    sides = np.block([[np.eye(joints), -np.ones((joints, 1))], [-np.eye(joints), -np.ones((joints, 1))]])
    solved = linprog(
        np.append(np.zeros(joints), 1.0),
        A_ub=sides,
        b_ub=np.zeros(2 * joints),
        A_eq=np.pad(jacobian, ((0, 0), (0, 1))),
        b_eq=velocity,
        bounds=[(None, None)] * (joints + 1),
    )
    return solved.fun if solved.status == 0 else np.inf


@pytest.mark.parametrize("strength", [0.9, 1.1])
def test_gravity_is_blamed_if_and_only_if_no_posture_can_be_held(strength):
    arm = pk.arms.tringali_3r().mounted(gravity=(0.0, -9.81, 0.0))
    path = pk.line([0.40, 0.05], [0.44, 0.05], duration=4.0, samples=26)
    hold = min(
        float(np.abs(gravity_torques(arm, q)).max())
        for q in all_postures(LENGTHS, path.positions[-1], np.linspace(-np.pi, np.pi, 2000, endpoint=False))
    )
    limits = pk.Limits(torque=strength * hold, velocity=0.5)
    problem = pk.Tracking(arm, path, objectives=[pk.kinetic_energy], limits=limits)
    if strength > 1:
        problem.require_feasible()
        return
    with pytest.raises(pk.Infeasible) as refused:
        problem.require_feasible()
    said = re.search(
        r"to hold the arm at rest at sample \d+ .* (joint\d) needs ([\d.]+) N m, its limit is ([\d.]+) N m",
        str(refused.value),
    )
    assert float(said[2]) == pytest.approx(hold, rel=0.02)
    assert float(said[3]) == pytest.approx(strength * hold, rel=0.01)
    assert "longer duration" not in str(refused.value)


def test_every_verb_refuses_with_the_same_words():
    arm, path = pk.arms.tringali_3r(), tringali_2020.straight(26)
    objectives = [pk.kinetic_energy, pk.torque_norm]
    problem = pk.Tracking(arm, path, objectives=objectives, limits=pk.Limits(velocity=1.8))
    reasons = []
    for verb in (pk.epsilon_front, pk.solve):
        with pytest.raises(pk.Infeasible, match="velocity of joint") as refused:
            verb(problem, observe=False)
        reasons.append(str(refused.value))
    assert reasons[0] == reasons[1]
    free = pk.solve(pk.Tracking(arm, path, objectives=objectives), population=8, generations=2, observe=False)
    motions = problem.task.motion(free.motions.q)
    stray = pk.Front(
        ids=free.ids,
        objectives=free.objectives,
        names=free.names,
        units=free.units,
        maximised=free.maximised,
        motions=motions,
    )
    with pytest.raises(pk.Infeasible, match="velocity of joint") as refused:
        pk.refine(stray, problem, observe=False)
    assert str(refused.value) == reasons[0]


# Warnings of obstacles on the path before any search


ARM = pk.arms.tringali_3r()
POINTS = PATH.positions


def planar(obstacles, *, arm=ARM, path=PATH, **settings):
    return pk.Tracking(arm, path, objectives=[pk.kinetic_energy], obstacles=obstacles, **settings)


@pytest.mark.parametrize("seed", range(8))
def test_a_warning_is_given_only_where_every_motion_violates_the_clearance(seed):
    rng = np.random.default_rng(seed)
    middle = POINTS[int(rng.integers(len(POINTS)))] + rng.normal(size=2) * 0.03
    radius, link_radius, smallest = (float(rng.uniform(0.001, 0.03)) for _ in range(3))
    settings = {"link_radius": link_radius, "limits": pk.Limits(clearance=smallest)}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        problem = planar([pk.obstacles.Circle(middle, radius)], **settings)
    gap = float(np.linalg.norm(POINTS - middle, axis=1).min()) - radius - link_radius
    assert bool(caught) == (gap < smallest)
    motions = problem.decode(problem.sample_starts(6, rng))
    distances = clearance(problem.task.obstacles, link_nodes(ARM, motions.q), link_radius).min(axis=-1)
    assert (distances <= gap + 1e-9).all()  # the reason of the warning: no motion is clearer than its tool

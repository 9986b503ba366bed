"""Sequential quadratic programming, compared with the interior point and on functions that only it solves."""

from dataclasses import replace

import numpy as np
import pytest

import paretoik as pk
from paretoik.nlp.minimise import minimise_violation
from paretoik.nlp.program import Goal, InteriorPointOptions
from paretoik.nlp.sqp import SqpOptions, minimise
from paretoik.trajectory.plan_starts import initial_motions
from paretoik.trajectory.transcription import motion_program
from problems import tringali_2020
from tests.pareto.motions import certify_motions

LIMITS = pk.Limits(position=tringali_2020.POSITION, velocity=tringali_2020.VELOCITY)


@pk.objective(unit="rad", form="general")
def reach_of_joint(motion):
    return np.ptp(motion.q[..., 1], axis=-1)


@pk.objective(unit="", form="integral")
def forward(motion):
    return np.where(motion.dq[..., 0] > 0, motion.dq[..., 0], 0.0) + np.linalg.norm(motion.dq[..., 1:], axis=-1)


@pk.objective(unit="", form="integral")
def memory(motion):
    return np.cumsum(motion.dq[..., 0] ** 2, axis=-1)


def problem_of(*objectives, limits=LIMITS, samples=26, **settings):
    settings = {"differences": "backward", "bases": 1, **settings}
    path = tringali_2020.straight(samples)
    return pk.Tracking(pk.arms.tringali_3r(), path, objectives=objectives, limits=limits, **settings)


def solved(task, q, **settings):
    program = motion_program(task)
    count = len(program.totals)
    goal = Goal(weights=np.ones(count), rows=np.eye(count), upper=program.upper)
    return minimise(program, q, goal, SqpOptions(**settings))


@pytest.mark.parametrize("name", ["simulation_2", "simulation_4"])
def test_both_solvers_agree_on_where_they_end_from_the_same_optimum(name):
    problem = getattr(tringali_2020, name)()
    best = pk.plan(problem, starts=4).best
    solution = solved(problem.task, best.motion.q, radius=0.01)
    assert solution.status == 0
    assert solution.objectives[0] == pytest.approx(best.objective, rel=1e-8)


@pytest.mark.parametrize(
    "objective",
    [pk.peak_torque, reach_of_joint, forward, memory],
    ids=lambda objective: objective.name,
)
def test_an_optimum_of_a_function_with_kinks_or_memory_is_critical_and_nothing_near_it_is_better(objective):
    problem = problem_of(objective)
    best = pk.plan(problem, starts=2).best
    task, q = problem.task, best.motion.q
    certificate = certify_motions(task, q[None], np.array([max(abs(best.objective), 1e-3)]))
    assert certificate.criticality[0] <= 1e-6
    assert certificate.violation[0] <= 1e-8
    for motion in nearby(task, q, 60):
        if task.violations(motion).max() <= 0:
            assert float(objective(motion)) >= best.objective - 1e-7 * (1 + abs(best.objective))


def nearby(task, q, count):
    """Return motions on the path near one, by smooth steps of the self-motion of many sizes."""
    rng = np.random.default_rng(0)
    at = motion_program(task).linearise(q)
    for _ in range(count):
        waves = np.cumsum(rng.normal(size=at.unknowns)) / at.unknowns
        step = np.pad(10 ** rng.uniform(-6, -1) * waves, (0, at.gradients.shape[1] - at.unknowns))
        yield task.motion(task.motion(q + at.displacement(step)).at(task.times))


@pytest.mark.parametrize(
    "objectives",
    [(pk.mechanical_energy,), (pk.peak_torque, pk.joint_travel), (reach_of_joint, pk.joint_drift, forward), (memory,)],
    ids=str,
)
def test_values_are_the_motions_and_slopes_those_of_differences(objectives):
    task = problem_of(*objectives).task
    program, q = motion_program(task), initial_motions(task, starts=3, seed=2)[1]
    at, step = program.linearise(q), 1e-8
    assert at.objectives == pytest.approx([float(o(task.motion(q))) for o in objectives], rel=1e-12)
    rng = np.random.default_rng(1)
    for _ in range(5):
        along = np.pad(rng.normal(size=at.unknowns), (0, at.gradients.shape[1] - at.unknowns))
        ahead, behind = (
            program.evaluate(task.motion(q + sign * step * at.displacement(along)).at(task.times))[0]
            for sign in (1, -1)
        )
        assert first_order(at, along) == pytest.approx((ahead - behind) / (2 * step), rel=1e-4, abs=1e-4)


def first_order(at, along):
    """Return the change of the totals along a step of the self-motion, with optimal slacks and epigraph variables."""
    from scipy.optimize import linprog

    unknowns, ties, columns = at.unknowns, at.elastic, at.gradients.shape[1]
    if unknowns == columns:
        return at.gradients @ along
    slopes, tight, solution = at.jacobian[ties:].toarray(), at.inequalities[ties:] < 1e-9, []
    for gradient in at.gradients:
        extra = linprog(
            gradient[unknowns:],
            A_ub=-slopes[tight][:, unknowns:],
            b_ub=slopes[tight][:, :unknowns] @ along[:unknowns],
            bounds=[(-1e3, None)] * (columns - unknowns),
        )
        cones = 0.0
        for cone in at.cones:
            cones += gradient[cone.column] * (cone.values @ (cone.rows @ along) / np.linalg.norm(cone.values) + 1e3)
        solution.append(gradient[:unknowns] @ along[:unknowns] + extra.fun + cones)
    return np.array(solution)


@pytest.mark.parametrize(
    "obstacle",
    [pk.obstacles.Box([0.15, 0.05], [0.02, 0.02]), pk.obstacles.Capsule([0.15, 0.05, -1], [0.15, 0.05, 1], 0.02)],
    ids=lambda obstacle: type(obstacle).__name__,
)
def test_a_motion_keeps_clear_of_obstacles_and_pays_for_it(obstacle):
    clear = pk.plan(problem_of(pk.kinetic_energy, obstacles=[obstacle], link_radius=0.01), starts=4).best
    assert clear.motion.clearance.min() >= -1e-8
    free = pk.plan(problem_of(pk.kinetic_energy), starts=4).best
    assert clear.objective > free.objective


def test_a_torque_limit_just_below_the_least_possible_is_refused_by_name_and_just_above_it_holds():
    smallest_peak = pk.plan(problem_of(pk.peak_torque, samples=16), starts=4).best.objective

    def limited(share):
        limits = replace(LIMITS, torque=share * smallest_peak)
        return pk.plan(problem_of(pk.kinetic_energy, limits=limits, samples=16), starts=2)

    with pytest.raises(
        pk.Infeasible, match=r"of the least-violating one, (torque|position|velocity) of joint\d .*at sample \d+"
    ):
        limited(0.999)
    assert np.abs(limited(1.001).best.motion.torque).max() <= 1.001 * smallest_peak * (1 + 1e-7)


def test_the_least_violation_is_found_where_limits_cannot_hold():
    task = problem_of(pk.kinetic_energy, limits=pk.Limits(velocity=1.0)).task
    q = initial_motions(task, starts=3, seed=0)
    program = motion_program(task)
    eased = minimise_violation(program, q, np.full(1, np.inf), [InteriorPointOptions()])

    def excess(x):  # of all samples and joints: what the interior point minimises
        return np.maximum(np.abs(task.motion(x).dq) - 1.0, 0.0).sum(axis=(1, 2))

    assert np.all(excess(eased.x) < excess(q))


def test_constraints_of_every_form_hold():
    @pk.constraint(unit="rad", form="terminal", upper=0.3)
    def drift(motion):
        return np.abs(motion.q[..., -1, 2] - motion.q[..., 0, 2])

    @pk.constraint(unit="rad", form="general", upper=0.8)
    def swing(motion):
        return np.ptp(motion.q[..., 0], axis=-1)

    @pk.constraint(unit="rad", form="integral", lower=0.2)
    def bent(motion):
        return motion.q[..., 1]

    @pk.constraint(unit="rad/s", form="peak", upper=2.4)
    def slow(motion):
        return np.maximum(np.abs(motion.dq[..., 0]), np.abs(motion.dq[..., 2]))

    free = pk.plan(problem_of(pk.kinetic_energy, samples=13), starts=4).best  # the best of all optima
    for limit in (drift, swing, bent, slow):
        solution = pk.plan(problem_of(pk.kinetic_energy, samples=13, constraints=[limit]), starts=1).best
        assert limit.violation(solution.motion) <= 1e-8
        assert solution.objective >= free.objective - 1e-9


def test_a_choice_that_jumps_is_refused_by_name():
    @pk.objective(unit="", form="integral")
    def jumping(motion):
        return np.sum(np.where(motion.q > 0.3, 1.0, 0.0) + motion.dq**2, axis=-1)

    with pytest.raises(pk.InvalidInput, match=r"jumping must have pieces that meet where the condition"):
        motion_program(problem_of(jumping).task)

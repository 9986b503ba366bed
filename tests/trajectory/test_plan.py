from functools import cache

import casadi
import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import EvaluationFailed, Infeasible, InvalidInput
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import InteriorPointOptions
from paretoik.trajectory.grid_oracle import grid_oracle
from paretoik.trajectory.levels import objective_scales
from paretoik.trajectory.motion_terms import joint_distance
from paretoik.trajectory.plan_starts import sample_starts
from paretoik.trajectory.transcription import motion_program
from problems import tringali_2020, tringali_2021
from studies.benchmarks.basins import ur10


def test_the_printed_arm_has_five_unconstrained_energy_optima():
    planned = pk.plan(tringali_2020.simulation_1())
    values = [optimum.objective for optimum in planned.optima]
    assert len(values) == 5
    assert values == sorted(values)
    assert len({optimum.label for optimum in planned.optima}) == 5


@pytest.mark.parametrize("number", [1, *(pytest.param(number, marks=pytest.mark.slow) for number in (2, 3, 4))])
def test_no_way_through_the_grid_beats_the_plan_from_a_given_start(number):
    problem = tringali_2021.problem(number, samples=51)
    planned, grid = pk.plan(problem), grid_oracle(problem.task, resolution=0.05, quick=True)
    assert planned.best.objective < grid.best
    assert np.isnan(grid.lower_bound)


def some_arm(seed, *, limited=False):
    """Return a planar arm of random links, and two postures for a path."""
    rng = np.random.default_rng(1000 + seed)
    lengths, masses = rng.uniform(0.15, 0.5, 3), rng.uniform(0.3, 2.0, 3)
    limits = np.deg2rad(rng.uniform(100, 170, 3)) if limited else None
    reach, turn = lengths.sum() * rng.uniform(0.25, 0.9, (2, 2)), rng.uniform(-np.pi, np.pi, 2)
    ends = [reach[0, i] * np.array([np.cos(turn[i]), np.sin(turn[i])]) for i in range(2)]
    return pk.Arm.planar(lengths=lengths, masses=masses, position_limits=limits), ends


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 8))])
@pytest.mark.parametrize("limited", [False, True])
def test_no_way_through_the_grid_beats_the_plan_of_a_random_arm(seed, limited):
    arm, ends = some_arm(seed, limited=limited)
    problem = pk.Tracking(
        arm, pk.line(*ends, duration=1.0, samples=51), objectives=[pk.kinetic_energy], differences="backward"
    )
    try:
        grid = grid_oracle(problem.task, resolution=0.06, quick=True).best
    except Infeasible:
        return
    assert pk.plan(problem).best.objective < grid


def test_a_function_that_fails_where_the_grid_probes_is_planned_for_without_its_grid():
    @pk.objective(unit="J", form="integral")
    def strict(motion):
        if isinstance(motion.dq, np.ndarray) and np.isnan(motion.dq).any():
            raise ValueError("nan given")
        return motion.kinetic_energy

    original = tringali_2021.problem(4, samples=51)
    problem = pk.Tracking(
        original.task.arm, original.task.tasks, objectives=[strict], start=tringali_2021.START, differences="backward"
    )
    with pytest.raises(
        InvalidInput, match="functions must accept NaN in rates: objective strict raised ValueError: nan given"
    ):
        grid_oracle(problem.task, quick=True)
    assert pk.plan(problem, starts=8).best.objective < 1.001 * pk.plan(original, starts=8).best.objective


@pytest.mark.slow
@pytest.mark.parametrize(("bad", "solver"), [(np.nan, "sqp"), (np.inf, "auto")])
def test_an_objective_without_a_value_where_every_search_begins_is_named(bad, solver):
    @pk.objective(unit="rad²/s", form="integral")
    def sometimes(motion):
        return np.where(motion.q[..., -1, :1] > -1.0, bad, motion.dq[..., -1] ** 2)

    line = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=26)
    limits = pk.Limits(position=np.deg2rad([90, 120, 120]))
    problem = pk.Tracking(pk.arms.tringali_3r(), line, objectives=[sometimes], limits=limits)
    with pytest.raises(EvaluationFailed, match=f"objective sometimes is {bad}"):
        pk.plan(problem, starts=3, solver=solver)


@cache
def plan_of(name):
    return pk.plan(getattr(tringali_2020, name)(), seed=3)


SLOW = [pytest.param(f"simulation_{i}", marks=pytest.mark.slow) for i in (1, 3, 4)]


@pytest.mark.parametrize("name", ["simulation_2", "simulation_5", *SLOW])
def test_optima_follow_the_path_within_the_limits_and_are_apart(name):
    problem = getattr(tringali_2020, name)()
    planned = plan_of(name)
    for i, optimum in enumerate(planned.optima):
        motion = optimum.motion
        assert optimum.status == "converged"
        assert motion.tracking_error.max() <= 1e-10
        assert problem.task.violations(motion).max(initial=-1.0) <= 1e-8
        assert optimum.objective == pytest.approx(float(problem.task.objectives[0](motion)), rel=1e-12)
        for other in planned.optima[:i]:
            assert joint_distance(problem.task, motion.q, other.motion.q) > 0.01


def test_the_energy_optimum_under_limits_is_that_of_ipopt():
    best = plan_of("simulation_2").best
    assert least_energy(tringali_2020.simulation_2().task, best.motion.q) == pytest.approx(best.objective, rel=1e-8)


def test_torque_limits_hold_and_cost():
    free = pk.plan(tringali_2020.simulation_3(), starts=6).best
    worst = np.abs(free.motion.torque).max()
    arm, path = pk.arms.tringali_3r(), tringali_2020.straight()
    limits = pk.Limits(position=tringali_2020.POSITION, velocity=tringali_2020.VELOCITY, torque=0.9 * worst)
    problem = pk.Tracking(arm, path, objectives=[pk.torque_norm], limits=limits, differences="backward")
    held = pk.plan(problem, starts=6).best
    assert np.abs(held.motion.torque).max() <= 0.9 * worst * (1 + 1e-8)
    assert held.objective > free.objective


def test_a_given_start_stays_and_given_motions_are_starts():
    arm, path = pk.arms.tringali_3r(), tringali_2020.straight(51)
    problem = pk.Tracking(arm, path, objectives=[pk.kinetic_energy], differences="backward")
    free = pk.plan(problem, starts=8).optima[-1]
    start = free.motion.q[0]
    held = pk.Tracking(arm, path, objectives=[pk.kinetic_energy], start=start, differences="backward")
    assert np.array_equal(pk.plan(held, starts=4).best.motion.q[0], start)
    planned = pk.plan(problem, starts=1, initial=free.motion)
    assert any(optimum.objective == pytest.approx(free.objective, rel=1e-9) for optimum in planned.optima)


@pytest.mark.parametrize(
    ("change", "said"),
    [({"starts": 0}, "starts"), ({"problem": tringali_2020.energy_torque}, "kinetic_energy, torque_norm")],
)
def test_what_cannot_be_planned_is_named(change, said):
    problem = change.pop("problem", tringali_2020.simulation_1)
    with pytest.raises(pk.InvalidInput, match=said):
        pk.plan(problem() if callable(problem) else problem, **change)


def least_energy(task, q0):
    """Return the energy optimum near q0 by IPOPT over all joint angles, with dynamics in absolute link angles."""
    lengths = np.array([0.176, 0.176, 0.1375])
    masses, centers = np.array([0.615, 0.615, 0.307]), np.array([0.0950, 0.0717, 0.0526])
    inertias = np.array([0.001811, 0.003173, 0.002103])
    samples, dt = len(task.times), task.times[1]
    q = casadi.MX.sym("q", 3, samples)
    energy, rows = 0, []
    for i in range(samples):
        phi = casadi.cumsum(q[:, i])
        reach = casadi.vertcat(
            casadi.sum1(lengths * casadi.cos(phi)) - task.targets[i, 0],
            casadi.sum1(lengths * casadi.sin(phi)) - task.targets[i, 1],
        )
        rows.append(reach)
        if i == 0:
            continue
        rate = casadi.cumsum((q[:, i] - q[:, i - 1]) / dt)
        joint = [0, 0]
        for k in range(3):
            direction = [-casadi.sin(phi[k]), casadi.cos(phi[k])]
            speed = [joint[a] + centers[k] * rate[k] * direction[a] for a in (0, 1)]
            energy += dt * (masses[k] * (speed[0] ** 2 + speed[1] ** 2) + inertias[k] * rate[k] ** 2) / 2
            joint = [joint[a] + lengths[k] * rate[k] * direction[a] for a in (0, 1)]
    rate = (q[:, 1:] - q[:, :-1]) / dt
    program = {"x": casadi.vec(q), "f": energy, "g": casadi.vertcat(*rows, casadi.vec(rate))}
    quiet = {"ipopt.print_level": 0, "print_time": False, "ipopt.tol": 1e-10, "ipopt.bound_relax_factor": 0.0}
    solver = casadi.nlpsol("solver", "ipopt", program, quiet)
    speed = tringali_2020.VELOCITY * np.ones(3 * (samples - 1))
    low, high = np.concatenate([np.zeros(2 * samples), -speed]), np.concatenate([np.zeros(2 * samples), speed])
    bound = np.tile(tringali_2020.POSITION, samples)
    return float(solver(x0=q0.ravel(), lbx=-bound, ubx=bound, lbg=low, ubg=high)["f"])


def test_a_travel_that_many_motions_share_has_an_end():
    @pk.objective(unit="rad", form="integral")
    def shoulder_travel(motion):
        return np.abs(motion.dq[..., 0]) + np.abs(motion.dq[..., 1])

    path = pk.line([0.6, -0.3, 0.4], [0.6, 0.3, 0.5], duration=2.0, samples=26)
    problem = pk.Tracking(ur10(np.random.default_rng(0)), path, objectives=[shoulder_travel])
    q = sample_starts(problem.task, 2, np.random.default_rng(0))
    program = motion_program(problem.task, objective_scales(problem.task, q))
    ends = minimise(program, q, np.ones((1, 1)), options=InteriorPointOptions(barrier=1e-2, radius=0.1))
    assert ends.converged.all()
    assert np.ptp(ends.objectives) < 1e-5 * ends.objectives.min()
    assert joint_distance(problem.task, ends.x[0], ends.x[1:]).min() > 0.1

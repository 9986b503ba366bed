"""Laws of the search for numbers of methods that resolve motions."""

from __future__ import annotations

import re

import numpy as np
import pytest

import paretoik as pk
from paretoik import line, measures, methods
from paretoik.errors import InvalidInput
from paretoik.robot import kinematics
from paretoik.robot.arms import tringali_3r
from tests.capability.test_geodesic import Even

PATH = line([0.4, 0.05], [0.3, 0.15], duration=1.0, samples=41)
BOTH = [pk.joint_limit_nearness, pk.manipulability]
ARM = pk.Arm.planar(
    lengths=[0.176, 0.176, 0.1375],
    masses=[0.6, 0.6, 0.3],
    centers=[0.09, 0.07, 0.05],
    inertias=[0.002, 0.003, 0.002],
    position_limits=([-1.5, -2.0, -2.0], [1.5, 2.0, 2.0]),
    velocity_limits=[3.0, 3.0, np.inf],
)
START = np.array([0.0, 0.327, -0.754])
FIRST = kinematics.forward_kinematics(tringali_3r(), START)[1][:2]
AHEAD = line(FIRST, FIRST + np.array([-0.27, 0.11]), duration=5.0, samples=51)
WEIGHTED, PLAIN = methods.WeightedGradientProjection(criteria=BOTH), methods.GradientProjection(criteria=BOTH)
EVEN = Even(np.eye(2), np.array([-0.6, -0.6]), np.array([0.6, 0.6]))  # 1 m/s everywhere
METHODS = {
    "DLS": methods.DampedLeastSquares(),
    "WLN": methods.WeightedLeastNorm(),
    "LSV": methods.LeastSquaresVelocity(),
    "pseudoinverse": methods.PseudoInverse(),
    "GPM": PLAIN,
    "WGPM": WEIGHTED,
    "PMKE": methods.PredictiveKineticEnergy(),
    "Nedungadi": methods.Nedungadi(),
    "time-optimal": pk.TimeOptimalControl(EVEN, period=0.01),
}


def tuning(method=WEIGHTED, **settings):
    return pk.Tuning(ARM, PATH, method, **{"judged_starts": 3, "tolerance": None, **settings})


def genes_of(problem, count=6, seed=0):
    return np.random.default_rng(seed).uniform(problem.xl, problem.xu, (count, problem.n_var))


@pytest.fixture(scope="module")
def optimum():
    problem = pk.Tracking(tringali_3r(), AHEAD, objectives=[pk.kinetic_energy], start=START, differences="backward")
    return pk.plan(problem, starts=8).best.motion


@pytest.fixture(scope="module")
def predictive(optimum):
    return pk.Tuning(
        tringali_3r(),
        AHEAD,
        methods.PredictiveKineticEnergy(),
        parameters=["horizon", "prediction_time", "update_share", "terminal"],
        objectives=[pk.kinetic_energy, measures.evaluations, measures.distance_to(optimum)],
        starts=[START],
    )


@pytest.mark.parametrize("name", METHODS)
def test_any_method_has_ranges_and_values_of_an_individual_do_not_depend_on_its_batch(name):
    path = line([0.4, 0.05], [0.3, 0.15], duration=1.0, samples=11)
    problem = pk.Tuning(ARM, path, METHODS[name], judged_starts=2)
    genes = genes_of(problem, 3)
    F, G = problem.evaluate(genes, return_values_of=["F", "G"])
    assert F.shape == (3, 4)
    assert np.isfinite(F).all()
    assert G.shape == (3, 1)
    assert problem.decode(genes).q.shape == (3, 11, 3)
    assert set(problem.values(genes)) == {field for each in problem.parameters for field in each.fields}
    np.testing.assert_array_equal(problem.evaluate(genes[1:2], return_values_of=["F"]), F[1:2])


@pytest.mark.parametrize(("method", "judged_by"), [(WEIGHTED, "worst"), (PLAIN, "mean")], ids=["weighted", "plain"])
def test_objectives_are_the_worst_or_the_mean_over_the_starts(method, judged_by):
    names = [each.name for each in method.parameters(PATH.times)]
    problem = tuning(method, judged_by=judged_by, parameters=["start", *names])
    genes = genes_of(problem, 3)
    F = problem.evaluate(genes)
    span = ARM.position_limits[:, 1] - ARM.position_limits[:, 0]
    reduce = np.max if judged_by == "worst" else np.mean
    for i, one in enumerate(genes):
        motions = []
        for start in problem.starts[problem.start_indices(genes)[i]]:
            motions.append(pk.resolve(ARM, PATH, problem.method(one[None]), start=start, unreachable="track")[0])
        margins = [np.minimum(m.q - ARM.position_limits[:, 0], ARM.position_limits[:, 1] - m.q) / span for m in motions]
        expected = [
            reduce([np.abs(m.traces.errors).max() for m in motions]),
            reduce([-margin.min() for margin in margins]),
            reduce([(np.abs(m.dq) / [3.0, 3.0, 1.0]).max() for m in motions]),
            reduce([pk.jerk(m) for m in motions]),
        ]
        np.testing.assert_allclose(F[i], expected, rtol=1e-9)


def test_an_individual_off_the_path_is_infeasible_and_says_so():
    away = pk.waypoints([[0.4, 0.05], [0.47, 0.1], [0.4, 0.05]], duration=1.0, samples=41)
    slow = methods.Parameter("feedback", 0.0, 1e-3)
    problem = pk.Tuning(ARM, away, methods.LeastSquaresVelocity(), parameters=[slow], tolerance=1e-4)
    genes = genes_of(problem, 2)
    G = problem.evaluate(genes, return_values_of=["G"])
    starts = problem.starts[problem.start_indices(genes)[0]]
    worst = []
    for one in genes:
        motions = pk.resolve(ARM, away, problem.method(one[None]), start=starts, unreachable="track")
        worst.append(np.abs(motions.traces.errors).max())
    np.testing.assert_allclose(G[:, 0], np.array(worst) / 1e-4 - 1, rtol=1e-9)
    assert all(reason.endswith(" m off the path") for reason in problem.explain(genes))
    with pytest.raises(pk.Infeasible, match="off the path"):
        pk.solve(problem, population=4, generations=2)


def test_motions_begin_at_the_starts_of_their_genes():
    problem = tuning(parameters=["start", "feedback", "gain of manipulability"])
    genes = genes_of(problem)
    assert problem.names == ("tracking_error", "limit_margin", "speed_ratio", "jerk")
    np.testing.assert_array_equal(problem.decode(genes).q[:, 0], problem.starts[problem.start_indices(genes)[:, 0]])


def test_predictive_control_is_judged_by_energy_work_and_distance(predictive, optimum):
    genes = genes_of(predictive, 5)
    F, G = predictive.evaluate(genes, return_values_of=["F", "G"])
    batch = predictive.method(genes)
    for i in range(5):
        one = methods.PredictiveKineticEnergy(
            horizon=int(batch.horizon[i]),
            prediction_step=float(batch.prediction_step[i]),
            update_interval=float(batch.update_interval[i]),
            terminal=float(batch.terminal[i]),
        )
        motion = pk.resolve(tringali_3r(), AHEAD, one, start=START, unreachable="track")
        distance = np.sqrt(np.mean(np.sum((motion.q - optimum.q) ** 2, axis=-1)))
        evaluations = one.horizon * (motion.traces.iterations + 1).mean()
        np.testing.assert_allclose(F[i], [float(pk.kinetic_energy(motion)), evaluations, distance], rtol=1e-9)
        assert (G[i, 0] <= 0) == (np.abs(motion.traces.errors).max() <= 0.05)


def test_no_motion_beats_the_optimum_and_a_front_trades_work_for_energy(predictive, optimum):
    front = pk.solve(predictive, population=12, generations=5, seed=0)
    assert front.names == ("kinetic_energy", "evaluations", "distance")
    lowest_energy = float(pk.kinetic_energy(optimum))
    assert (front.objectives[:, 0] > 0.999 * lowest_energy).all()
    assert front.objectives[0, 0] < 1.2 * lowest_energy
    assert len(front) > 1
    assert front.motions.q.shape[1:] == (51, 3)


def test_time_optimal_control_is_tuned_by_its_duration_and_the_work_of_a_plan():
    problem = pk.Tuning(
        ARM,
        PATH,
        pk.TimeOptimalControl(EVEN, period=0.01),
        objectives=[measures.duration, measures.evaluations, measures.tracking_error, pk.kinetic_energy],
        judged_starts=1,
    )
    genes = genes_of(problem, 3)
    F = problem.evaluate(genes, return_values_of=["F"])
    method, motions = problem.method(genes), problem.decode(genes)
    for i in range(3):
        run = pk.capability.time_optimal_control(
            EVEN,
            [0.4, 0.05],
            [0.3, 0.15],
            horizon=int(method.horizon[i]),
            period=method.period[i],
            gain=method.gain[i],
            initial=motions.tool[i, 0],
        )
        assert F[i, :2] == pytest.approx([run.settled, run.iterations.mean()])
        assert motions.time[i, -1] == run.settled
    assert motions.tool[:, -1] == pytest.approx(np.tile([0.3, 0.15], (3, 1)), abs=2e-6)
    assert F[:, 2].max() < 1e-3


def test_a_users_constraint_holds_from_every_start_or_the_individual_is_infeasible():
    @pk.constraint(unit="rad/s", upper=1.5)
    def slow_wrist(motion):
        return np.abs(motion.dq[..., -1])

    problem, free = tuning(constraints=[slow_wrist], tolerance=0.05), tuning(tolerance=0.05)
    genes = genes_of(problem, 6)
    G, motion = problem.evaluate(genes, return_values_of=["G"]), problem._follow(genes, problem.start_indices(genes))
    worst = slow_wrist.violation(motion).reshape(6, problem.judged_starts).max(axis=1)
    assert problem.constraint_names == ("tracking", "slow_wrist")
    assert G[:, 0] == pytest.approx(free.evaluate(genes, return_values_of=["G"])[:, 0])
    assert G[:, 1] == pytest.approx(worst)
    assert (worst > 0).any()
    for words, row in zip(problem.explain(genes), G, strict=True):
        assert bool(words) == (row.max() > 0)
        assert ("slow_wrist is violated by" in words) == (row[1] > max(row[0], 0.0))


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"method": "heavy"}, "method must be one of pk.methods, such as DampedLeastSquares(), got 'heavy'"),
        ({"judged_starts": 10_000}, "judged_starts must be from 1 to "),
        ({"starts": np.full((4, 3), np.nan)}, "starts: must be finite, got nan at index (0, 0)"),
        ({"objectives": [measures.evaluations]}, "evaluations: method must look ahead"),
        (
            {"parameters": ["feed"]},
            "parameters must be among feedback, region, damping, buffer, repulsion, band, gain of joint_limit_",
        ),
        ({"parameters": ["band", "band"]}, "parameters must set each field once, got band, band"),
        (
            {
                "method": methods.GradientProjection(
                    criteria=[methods.Criterion(objective=pk.manipulability, gain=np.ones(2))]
                )
            },
            "manipulability: gain must be one number",
        ),
        (
            {"method": methods.PredictiveKineticEnergy(objective=pk.peak_torque)},
            "objective peak_torque: form must be 'integral'",
        ),
    ],
)
def test_what_cannot_be_used_is_refused_by_name(changed, message):
    with pytest.raises(InvalidInput, match=re.escape(message)):
        tuning(**changed)

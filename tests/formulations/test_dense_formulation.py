"""A user's own objectives and constraints in small programs: one definition is searched, refined and shown."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import InvalidInput

START, TARGET = [0.1, -0.15], [0.2, -0.15]
WAYS = [[1.0, 0.0], [0.0, 1.0]]
ARM, MOTORS = pk.arms.kim_3r(), pk.capability.kim_joint_motors()


@pk.objective(unit="rad²/s", form="integral")
def effort(motion):
    return np.sum(motion.dq**2, axis=-1)


@pk.objective(unit="rad", form="integral")
def travel(motion):
    return np.sum(np.abs(motion.dq), axis=-1)


@pk.objective(unit="rad/s", form="peak")
def fastest(motion):
    return np.max(np.abs(motion.dq), axis=-1)


@pk.objective(unit="m", form="general")
def length(motion):
    return np.sum(np.linalg.norm(np.diff(motion.tool, axis=-2), axis=-1), axis=-1)


@pk.objective(unit="m s", form="integral", maximise=True)
def late_height(motion):
    return motion.tool[..., 1] * motion.time


@pk.objective(unit="m", form="general", maximise=True)
def elbow(motion):
    return motion.links[..., 0, 2, 1]


@pk.objective(unit="rad", form="peak")
def bend(motion):
    return np.abs(motion.q[..., 1]) + np.abs(motion.q[..., 2] - 0.3)


@pk.constraint(unit="m", upper=-0.14)
def under_the_shelf(motion):
    return motion.tool[..., 1]


@pk.constraint(unit="rad", form="integral", upper=2.0)
def short(motion):
    return np.sum(np.abs(motion.dq), axis=-1)


@pk.constraint(unit="rad", form="terminal", lower=-1.0, upper=1.0)
def turned(motion):
    return motion.q[..., -1, 0] - motion.q[..., 0, 0]


@pk.constraint(unit="m", upper=0.0)
def low_elbow(motion):
    return motion.links[..., 2, 1]


def way(objectives, constraints=(), motors=MOTORS, **settings):
    settings = {"samples": 9, "coefficients": 4, "bases": 4, "energy": False, **settings}
    return pk.PointToPoint(ARM, motors, START, TARGET, objectives=objectives, constraints=constraints, **settings)


def posture(objectives, constraints=(), motors=MOTORS, **settings):
    settings = {"power": False, "starts": 60, **settings}
    return pk.DirectionalMaxima(ARM, motors, TARGET, WAYS, objectives=objectives, constraints=constraints, **settings)


def own_values(problem, motions):
    return np.stack([each.sign * each(motions) for each in problem.functions.objectives], axis=1)


PROBLEMS = {
    "integral": lambda: way([effort, pk.torque_norm], [under_the_shelf]),
    "kinks": lambda: way([travel], [short], energy=True),
    "whole motion": lambda: way([length, late_height], [turned]),
    "sliders": lambda: way([travel, effort], motors=pk.capability.kim_sliders()),
    "posture": lambda: posture([pk.manipulability, elbow], [low_elbow], power=True),
    "posture, kinks": lambda: posture([bend, pk.torque_norm]),
}


@pytest.fixture(scope="module", params=PROBLEMS)
def problem(request):
    return PROBLEMS[request.param]()


def points_near(problem, count):
    genes = problem.sample_starts(40, np.random.default_rng(0))
    z = problem.points(genes)
    rows = np.flatnonzero(np.isfinite(z).all(axis=1))[:count]
    return genes[rows], z[rows]


def test_search_and_smooth_program_agree_with_the_definition(problem):
    genes, z = points_near(problem, 6)
    F = problem.evaluate(genes, return_values_of=["F"])
    own = own_values(problem, problem.decode(genes))
    assert F[:, -own.shape[1] :] == pytest.approx(own, rel=1e-12)
    assert z @ problem.program().costs.T == pytest.approx(F, rel=1e-9, abs=1e-12)


def test_violations_of_constraints_are_those_of_the_definition(problem):
    genes, z = points_near(problem, 20)
    G, motions = problem.evaluate(genes, return_values_of=["G"]), problem.decode(genes)
    constraints = problem.functions.constraints
    own = np.array([each.violation(motions) for each in constraints]).T.reshape(len(genes), -1)
    first = list(problem.constraint_names).index(constraints[0].name) if constraints else G.shape[1]
    assert G[:, first:] == pytest.approx(own, abs=1e-8)
    assert (G.max(axis=1) <= 0).any()
    for one in z[G.max(axis=1) <= 0]:
        equal, slacks = problem.program().rows.rows(one)
        assert np.abs(equal).max() <= 1e-9
        assert slacks.min() >= -1e-8


def test_derivatives_are_those_of_the_rows(problem):
    rows, z = problem.program().rows, points_near(problem, 1)[1][0]
    rng, step = np.random.default_rng(0), 1e-6
    z, direction = z + 1e-3 * rng.normal(size=len(z)), 0.1 * rng.normal(size=len(z))
    ahead, behind = (np.concatenate(rows.rows(z + sign * step * direction)) for sign in (1, -1))
    along = rows.jacobian(z) @ direction
    assert along == pytest.approx((ahead - behind) / (2 * step), abs=1e-6 * np.abs(along).max())
    weights = rng.normal(size=len(ahead))
    slopes = [weights @ rows.jacobian(z + sign * step * direction) for sign in (1, -1)]
    curved = rows.hessian(z, weights) @ direction
    assert curved == pytest.approx((slopes[0] - slopes[1]) / (2 * step), abs=1e-5 * np.abs(curved).max())


@pytest.mark.parametrize(
    "make",
    [lambda: way([fastest], [short]), lambda: posture([pk.manipulability], [low_elbow], power=True)],
    ids=["fastest", "posture"],
)
def test_a_front_with_a_users_objective_is_refined_certified_and_recomputed(make):
    problem = make()
    front = pk.solve(problem, population=24, generations=12, seed=1, points=4)
    refined = pk.refine(front)
    before = dict(zip(front.ids, front.minimised, strict=True))
    for number, row in zip(refined.ids, refined.minimised, strict=True):
        assert (row <= before[number] + 1e-7 * np.abs(before[number]).max()).all()
    assert refined.minimised.sum() < front.minimised.sum()
    assert np.median(refined.certificates.criticality) <= 1e-7
    assert (refined.certificates.status == "minimum").mean() >= 0.75
    own = own_values(problem, refined.motions)
    assert refined.minimised[:, -own.shape[1] :] == pytest.approx(own, rel=1e-12)
    for each in problem.functions.constraints:
        assert each.violation(refined.motions).max() <= 1e-8


def test_the_motions_of_directional_maxima_stand_in_their_postures(tmp_path):
    problem = posture([bend])
    front = pk.solve(problem, population=20, generations=5, seed=0, points=3)
    assert front.motions.q.shape == (len(front), 3, 3)
    assert np.ptp(front.motions.q, axis=1).max() == 0
    assert front.motions.tool == pytest.approx(np.broadcast_to(TARGET, front.motions.tool.shape), abs=1e-9)
    front.save(tmp_path)
    again = pk.load_front(tmp_path, problem)
    assert np.array_equal(again.motions.q, front.motions.q)


@pk.objective(unit="", form="integral")
def misshapen(motion):
    return motion.q


@pk.objective(unit="", form="general")
def middling(motion):
    return np.median(motion.q[..., 0], axis=-1)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: way([pk.measures.duration]), "must have names other than duration, ends, joint limits, motors"),
        (
            lambda: way([misshapen]),
            r"objective misshapen \(integral\) must return shape .*, here \(4, 9\), got \(4, 9, 3\)",
        ),
        (lambda: way([middling]).program(), "objective middling: .*median"),
        (lambda: posture([pk.kinetic_energy]), "kinetic_energy must depend on the posture"),
    ],
)
def test_what_cannot_be_served_is_refused_by_name(make, message):
    with pytest.raises(InvalidInput, match=message) as error:
        make()
    assert "\n" not in str(error.value)

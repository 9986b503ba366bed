"""Trade-offs between directions: genes and the smooth program agree, and refinement only improves."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import Infeasible, InvalidInput
from paretoik.nlp.minimise import minimise
from paretoik.robot import kinematics

PLACE = [0.2, -0.15]
WAYS = [[1.0, 0.0], [0.0, 1.0]]
MOTORS, SLIDERS = pk.capability.kim_joint_motors(), pk.capability.kim_sliders()
PROBLEMS = {
    "motors": (MOTORS, "velocity"),
    "speed against force of sliders": (SLIDERS, ["velocity", "force"]),
}


@pytest.fixture(scope="module", params=PROBLEMS)
def problem(request):
    actuation, quantity = PROBLEMS[request.param]
    return pk.DirectionalMaxima(pk.arms.kim_3r(), actuation, PLACE, WAYS, quantity=quantity)


@pytest.fixture(scope="module")
def front(problem):
    return pk.solve(problem, population=32, generations=20, seed=1, points=12)


@pytest.fixture(scope="module")
def refined(front):
    return pk.refine(front)


def test_individuals_stand_at_the_position_and_move_along_the_directions(problem, front):
    at = problem.configuration(front.genes)
    assert kinematics.forward_kinematics(problem.arm, at.q)[1][:, :2] == pytest.approx(
        np.tile(PLACE, (len(front), 1)), abs=1e-9
    )
    columns, moving = kinematics.jacobian(problem.arm, at.q)[:, :2], problem.moving
    moved = np.einsum("paj,pkj->pka", columns, at.dq)
    assert moved == pytest.approx(at.values[:, moving, None] * np.array(WAYS)[moving], abs=1e-9)
    assert front.objectives[:, :2] == pytest.approx(at.values)
    assert problem.power == moving.any()
    if problem.power:
        assert front.objectives[:, 2] == pytest.approx(at.power.max(axis=1))


def test_no_individual_does_more_than_the_directional_maximum(problem, refined):
    each = [
        pk.directional_maxima(problem.arm, problem.actuation, PLACE, [way], quantity=quantity).values
        for way, quantity in zip(WAYS, problem.quantities, strict=True)
    ]
    maxima = np.concatenate(each)
    assert (refined.objectives[:, :2] <= maxima * (1 + 1e-9)).all()
    assert (refined.objectives[:, :2].max(axis=0) >= 0.8 * maxima).all()


def test_exchange_rates_are_those_of_neighbouring_optima(problem, refined):
    """Ask for a little more and less of the first, with others held: the last one's cost bounds the rate."""
    program, rates, step, last = problem.program(), refined.certificates, 1e-6, problem.n_obj - 1
    sign = -1.0 if problem.maximised[last] else 1.0  # a cost in force lowers it
    ranges, z = np.ptp(refined.minimised, axis=0), problem.points(refined.genes)
    finite = np.isfinite(rates.exchange_intervals[:, 0, last]).all(axis=1)
    good = np.flatnonzero((rates.weights.min(axis=1) > 0.05) & (rates.status == "minimum") & finite)
    assert len(good) >= 3
    for i in good[:5]:
        costs, unit = [], np.eye(problem.n_obj)
        for change in (-step, 0.0, step):
            bounds = (program.costs @ z[i] + change * ranges * unit[0]) / ranges
            upper = np.where(unit[last] > 0, np.inf, bounds)[None]
            end = minimise(problem.program(ranges), z[i : i + 1], unit[last:], upper, solver="sqp")
            assert end.converged.all()
            costs.append(end.objectives[0, last] * ranges[last])
        more, less = -np.diff(costs) / (step * ranges[0])
        low, high = np.sort(sign * rates.exchange_intervals[i, 0, last])
        assert (more + less) / 2 == pytest.approx((low + high) / 2, rel=2e-2)
        assert less >= low - 0.05 * high
        assert more <= high * 1.05


@pytest.mark.usefixtures("unchecked")
def test_impossible_directional_maxima_are_refused_by_name(problem, front):
    with pytest.raises(Infeasible, match=r"joint2 must bear a torque of at most 3\.5 N m"):
        pk.DirectionalMaxima(pk.arms.kim_3r().with_payload(20.0), pk.capability.kim_joint_motors(), PLACE, WAYS)
    with pytest.raises(InvalidInput, match="at least one, got"):
        pk.DirectionalMaxima(pk.arms.kim_3r(), pk.capability.kim_joint_motors(), PLACE, [[1.0, 0.0, 0.0]])
    other = pk.DirectionalMaxima(pk.arms.kim_3r(), pk.capability.kim_joint_motors(), PLACE, WAYS, power=False)
    with pytest.raises(
        InvalidInput, match=f"problem must have the objectives {', '.join(problem.names)}, got {', '.join(other.names)}"
    ):
        pk.refine(front, other)

"""A certified front does not depend on units, the scale of an objective, or the number of samples."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.trajectory.motion_terms import joint_distance
from problems import tringali_2020
from tests.pareto.motions import certify_motions

LIMITS = pk.Limits(position=tringali_2020.POSITION, velocity=tringali_2020.VELOCITY)
CHOICE = pk.Weights({"kinetic_energy": 0.4, "theirs": 0.6})


def effort(factor):
    """Return an objective of squared torques, as the library's norm, in any unit."""

    @pk.objective(unit="", form="integral", name="theirs")
    def theirs(motion):
        return factor * np.sum(motion.torque**2, axis=-1)

    return theirs


def tool_detour(factor):
    """Return an objective of the second joint's squared distance from its place on a straight arm, m² s or mm² s."""

    @pk.objective(unit="", form="integral", name="theirs")
    def theirs(motion):
        first, second = motion.q[..., 0], motion.q[..., 0] + motion.q[..., 1]
        x = factor * (0.176 * np.cos(first) + 0.176 * np.cos(second))
        y = factor * (0.176 * np.sin(first) + 0.176 * np.sin(second))
        return (x - factor * 0.3) ** 2 + y**2

    return theirs


def tracking(other, samples=26, limits=LIMITS):
    path = tringali_2020.straight(samples)
    return pk.Tracking(
        pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy, other], limits=limits, differences="backward"
    )


def front_of(other, samples=26, limits=LIMITS):
    return pk.epsilon_front(tracking(other, samples, limits), points=5, starts=8)


# Objectives, their inner factor, and its effect on their value
FORMS = {
    "a billionth as large": (effort, 1e-9, 1e-9),
    "in mm": (tool_detour, 1e3, 1e6),
}


@pytest.fixture(scope="module")
def plain():
    return {make: front_of(make(1.0)) for make in (effort, tool_detour)}


@pytest.fixture(scope="module")
def scaled():
    return {name: front_of(make(factor)) for name, (make, factor, _) in FORMS.items()}


@pytest.mark.parametrize("name", FORMS)
def test_an_objective_has_the_same_front_but_for_its_factor(name, plain, scaled):
    make, _, scale = FORMS[name]
    one, other = plain[make], scaled[name]
    assert len(one) == len(other) >= 5
    natural = np.array([1.0, scale])
    ranges = np.ptp(one.objectives, axis=0)
    np.testing.assert_allclose(other.objectives / natural / ranges, one.objectives / ranges, atol=1e-7)
    np.testing.assert_allclose(other.shares, one.shares, atol=1e-7)


@pytest.mark.parametrize("name", FORMS)
def test_certificates_are_the_same_whatever_the_unit(name, plain, scaled):
    make, _, scale = FORMS[name]
    one, other = plain[make].certificates, scaled[name].certificates
    assert max(one.criticality.max(), other.criticality.max()) <= 1e-6
    assert other.status.tolist() == one.status.tolist()
    np.testing.assert_allclose(other.weights, one.weights, atol=1e-5)
    ends = one.weights.min(axis=1) > 1e-3
    np.testing.assert_allclose(other.exchange_rates[ends, 0, 1], scale * one.exchange_rates[ends, 0, 1], rtol=1e-4)


@pytest.mark.parametrize("name", FORMS)
def test_the_criticality_of_a_motion_that_is_not_optimal_is_the_same_whatever_the_unit(name):
    make, factor, scale = FORMS[name]
    criticalities = []
    for unit, natural in ((1.0, 1.0), (factor, scale)):
        problem = tracking(make(unit))
        q = problem.decode(np.atleast_2d((problem.xl + problem.xu) / 2)).q
        criticalities.append(certify_motions(problem.task, q, np.array([0.05, 0.05 * natural])).criticality[0])
    assert criticalities[0] > 1e-3
    assert criticalities[1] == pytest.approx(criticalities[0], rel=1e-6)


@pytest.mark.parametrize("name", FORMS)
def test_the_same_motion_is_chosen_whatever_the_unit(name, plain, scaled):
    make, *_ = FORMS[name]
    one, other = plain[make].select(CHOICE), scaled[name].select(CHOICE)
    assert one.index == other.index
    assert float(joint_distance(plain[make].problem.task, other.motion.q, one.motion.q)) < 1e-4


@pytest.fixture(scope="module")
def doubled():
    """Return fronts at 51 and at 101 samples, without limits, which are satisfied only at samples."""
    return [front_of(effort(1.0), samples, limits=None) for samples in (51, 101)]


def test_twice_as_many_samples_leave_every_point_a_critical_minimum(doubled):
    for front in doubled:
        assert front.certificates.criticality.max() <= 1e-8
        assert set(front.certificates.status) == {"minimum"}


@pytest.mark.parametrize("end", [0, 1])
def test_twice_as_many_samples_change_an_end_of_the_front_by_the_discretisation_alone(end, doubled):
    """The finer optimum is no worse than the coarser motion on the finer samples, and vice versa."""
    (coarse, coarser), (fine, finer) = ((front, front.problem.task) for front in doubled)
    objective = finer.objectives[end]
    best = [front.motions[int(front.objectives[:, end].argmin())] for front in (coarse, fine)]
    values = [float(objective(motion)) for motion in best]
    up = float(objective(finer.motion(coarser.motion(best[0].q).at(finer.times)))) - values[0]
    down = values[1] - float(objective(coarser.motion(best[1].q[::2])))
    assert down - 1e-6 * values[0] <= values[1] - values[0] <= up + 1e-6 * values[0]
    assert max(abs(up), abs(down)) < 0.1 * values[0]


def test_with_twice_as_many_samples_the_motion_chosen_is_nearer_than_any_other_point(doubled):
    coarse, fine = doubled
    task = fine.problem.task
    one = np.asarray(coarse.problem.task.motion(coarse.select(CHOICE).motion.q).at(task.times))
    chosen = fine.select(CHOICE)
    apart = joint_distance(task, one, np.asarray(fine.motions.q))
    assert apart.argmin() == chosen.index
    assert apart.min() < 0.3 * np.sort(apart)[1]

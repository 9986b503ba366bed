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


SCALE = 1e-9  # of the second objective's unit


def effort(factor):
    """Return an objective of squared torques, as the library's norm, in any unit."""

    @pk.objective(unit="", form="integral", name="theirs")
    def theirs(motion):
        return factor * np.sum(motion.torque**2, axis=-1)

    return theirs


def tracking(factor, samples=26, limits=LIMITS):
    objectives = [pk.kinetic_energy, effort(factor)]
    path = tringali_2020.straight(samples)
    return pk.Tracking(pk.arms.tringali_3r(), path, objectives=objectives, limits=limits, differences="backward")


def front_of(factor, samples=26, limits=LIMITS):
    return pk.epsilon_front(tracking(factor, samples, limits), points=5, starts=4)


@pytest.fixture(scope="module")
def plain():
    return front_of(1.0)


@pytest.fixture(scope="module")
def scaled():
    return front_of(SCALE)


def test_an_objective_has_the_same_front_but_for_its_factor(plain, scaled):
    assert len(plain) == len(scaled) >= 4
    ranges = np.ptp(plain.objectives, axis=0)
    np.testing.assert_allclose(scaled.objectives / [1.0, SCALE] / ranges, plain.objectives / ranges, atol=1e-7)
    np.testing.assert_allclose(scaled.shares, plain.shares, atol=1e-7)


def test_certificates_are_the_same_whatever_the_unit(plain, scaled):
    one, other = plain.certificates, scaled.certificates
    assert max(one.criticality.max(), other.criticality.max()) <= 1e-6
    assert other.status.tolist() == one.status.tolist()
    np.testing.assert_allclose(other.weights, one.weights, atol=1e-5)
    ends = one.weights.min(axis=1) > 1e-3
    np.testing.assert_allclose(other.exchange_rates[ends, 0, 1], SCALE * one.exchange_rates[ends, 0, 1], rtol=1e-4)


def test_the_criticality_of_a_motion_that_is_not_optimal_is_the_same_whatever_the_unit():
    criticalities = []
    for unit in (1.0, SCALE):
        problem = tracking(unit)
        q = problem.decode(np.atleast_2d((problem.xl + problem.xu) / 2)).q
        criticalities.append(certify_motions(problem.task, q, np.array([0.05, 0.05 * unit])).criticality[0])
    assert criticalities[0] > 1e-3
    assert criticalities[1] == pytest.approx(criticalities[0], rel=1e-6)


def test_the_same_motion_is_chosen_whatever_the_unit(plain, scaled):
    one, other = plain.select(CHOICE), scaled.select(CHOICE)
    assert one.index == other.index
    assert float(joint_distance(plain.problem.task, other.motion.q, one.motion.q)) < 1e-4


@pytest.fixture(scope="module")
def doubled():
    """Return fronts at 26 and at 51 samples, without limits, which are satisfied only at samples."""
    return [front_of(1.0, samples, limits=None) for samples in (26, 51)]


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

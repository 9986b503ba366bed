"""The certified front of optimal points: saddles are replaced by the minima next to them."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.formulations.protocol import require_program
from paretoik.pareto import certified_front as module
from paretoik.pareto.certified_front import Certifier, certified_front

ANGLE, NEAR, FAR = 0.9, 0.2, 0.4  # rad


def well(motion, width):
    """Least if the first joint rests at one of two angles; the maximum between them is critical too."""
    return ((motion.q[..., 0] - ANGLE) ** 2 - width**2) ** 2 + 0.1 * motion.dq[..., 0] ** 2


@pk.objective(unit="rad⁴s", form="integral")
def near_wells(motion):
    """Return the distance of the first joint from two angles, one on each side of ANGLE."""
    return well(motion, NEAR)


@pk.objective(unit="rad⁴s", form="integral")
def far_wells(motion):
    """Return the same for two angles that are farther apart."""
    return well(motion, FAR)


@pk.objective(unit="rad²s", form="integral")
def offset(motion):
    """Return the squared distance of the first joint from ANGLE."""
    return (motion.q[..., 0] - ANGLE) ** 2


def tracked(objectives, differences="backward"):
    path = pk.line((0.2, 0.1), (0.2, 0.2), duration=1.0, samples=41)
    return pk.Tracking(pk.arms.tringali_3r(), path, objectives=objectives, differences=differences)


@pytest.fixture(scope="module", params=["backward", "spline"])
def problem(request):
    return tracked([near_wells, far_wells], request.param)


@pytest.fixture(scope="module")
def saddle(problem):
    """The motion whose first joint stays at ANGLE: critical for both objectives, and a maximum of both."""
    q = pk.plan(tracked([offset], "spline"), starts=4, observe=False).best.motion.q
    program = problem.program(np.ones(2))
    for _ in range(6):  # Newton's method for their sum
        at = program.linearise(q)
        hessian = at.hessian(np.ones(2), np.zeros(len(at.inequalities))).toarray()
        q = at.retract(-np.linalg.solve(hessian, at.gradients.sum(axis=0)))
    return q[None]


def certified(problem, x):
    return certified_front(Certifier(formulation=problem), x, np.arange(len(x)) + 7, np.full(2, 1e-3), {})


def test_a_saddle_gives_way_to_a_minimum_that_is_better_in_every_objective(problem, saddle):
    front = certified(problem, saddle)
    assert front.ids.tolist() == [7]
    assert front.certificates.status.tolist() == ["minimum"]
    assert (front.objectives[0] < [NEAR**4, FAR**4]).all()
    assert np.sqrt(front.objectives[0]).sum() == pytest.approx(FAR**2 - NEAR**2, rel=1e-6)  # in closed form


def test_without_rounds_a_saddle_stays_and_is_called_one(problem, saddle, monkeypatch):
    monkeypatch.setattr(module, "OPTIONS", module.CertifiedFrontOptions(rounds=0))
    front = certified(problem, saddle)
    assert front.certificates.status.tolist() == ["saddle"]
    np.testing.assert_allclose(front.objectives[0], [NEAR**4, FAR**4], rtol=1e-6)


def test_a_minimum_next_to_a_saddle_stays_unless_it_is_dominated(problem, saddle):
    minimum = certified(problem, saddle).motions.q
    front = certified(problem, np.concatenate([saddle, minimum]))
    assert set(front.ids.tolist()) <= {7, 8}
    assert (front.certificates.status == "minimum").all()
    formulation = require_program("refine", problem)
    assert (front.objectives <= formulation.individuals(minimum).objectives + 1e-12).all(axis=1).any()


def check_weights_are_over_the_ranges(front):
    """Exchange rates, in natural units, are the ratios of the weights over the ranges of the front."""
    certificates, low, high = front.certificates, *front.ranges.T
    natural = certificates.weights / (high - low) * np.where(front.maximised, -1.0, 1.0)
    expected = -natural[:, :, None] / natural[:, None, :]
    known = np.isfinite(certificates.exchange_rates) & ~np.eye(len(low), dtype=bool)
    assert known.any()
    np.testing.assert_allclose(certificates.exchange_rates[known], expected[known], rtol=1e-6)
    np.testing.assert_allclose(certificates.weights.sum(axis=1), 1.0, rtol=1e-12)


PATH = pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=15)


@pytest.mark.parametrize("second", [pk.peak_torque, pk.manipulability], ids=lambda each: each.name)
def test_weights_are_over_the_ranges_of_the_front_that_is_returned(second):
    problem = pk.Tracking(pk.arms.tringali_3r(), PATH, objectives=[pk.kinetic_energy, second])
    searched = pk.solve(problem, population=16, generations=10, seed=1, refine=True, points=6)
    swept = pk.epsilon_front(problem, points=4)
    again = pk.refine(searched[searched.ids[1:-1].tolist()], problem)
    merged = pk.compare(searched, swept).merged
    for front in (searched, swept, again, merged):
        check_weights_are_over_the_ranges(front)

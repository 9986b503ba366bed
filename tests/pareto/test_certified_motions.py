import numpy as np
import pytest
from scipy import sparse

import paretoik as pk
from paretoik.nlp.program import Constraints
from paretoik.pareto.certificates import exchange_rates, weight_ratios
from problems import tringali_2020
from tests.pareto.motions import certify_motions


@pytest.mark.parametrize("name", [f"simulation_{i}" for i in range(1, 6)])
def test_planned_optima_are_certified_minima(name):
    problem = getattr(tringali_2020, name)()
    planned = pk.plan(problem, starts=24)
    certificate = certify_motions(
        problem.task, np.stack([o.motion.q for o in planned.optima]), np.array([planned.best.objective])
    )
    assert certificate.criticality.max() <= 1e-6
    assert certificate.violation.max() <= 1e-8
    assert set(certificate.status) == {"minimum"}


def test_a_motion_that_is_not_optimal_has_a_criticality():
    problem = tringali_2020.simulation_1()
    best = pk.plan(problem, starts=12).best
    q = problem.decode(np.atleast_2d((problem.xl + problem.xu) / 2)).q
    certificate = certify_motions(problem.task, q, np.array([best.objective]))
    assert certificate.criticality[0] > 1e-3
    assert certificate.status[0] == "undetermined"


def test_units_do_not_matter():
    criticalities = []
    for factor in (1.0, 1e-6, 1e6):
        effort = pk.objective(unit="", form="integral")(
            lambda motion, factor=factor: factor * np.sum(motion.dq**2, axis=-1)
        )
        problem = pk.Tracking(
            pk.arms.tringali_3r(), tringali_2020.straight(51), objectives=[effort], bases=1, differences="backward"
        )
        q = problem.decode(np.atleast_2d((problem.xl + problem.xu) / 2)).q
        criticalities.append(certify_motions(problem.task, q, np.array([factor])).criticality[0])
    assert criticalities[0] > 1e-3
    assert criticalities[1:] == pytest.approx(criticalities[:1] * 2, rel=1e-6)


def test_exchange_rates_stand_in_natural_units_and_own_signs():
    weights, ranges, signs = np.array([[0.75, 0.25], [1.0, 0.0]]), np.array([2.0, 10.0]), np.array([1.0, -1.0])
    ratios = np.stack([weights[:, :, None] / np.maximum(weights, 1e-300)[:, None, :]] * 2, axis=-1)
    rates = exchange_rates(weights, ratios, ranges, signs)
    assert rates[0] == pytest.approx(np.array([[1.0, 15.0], [1 / 15.0, 1.0]]))
    assert np.isnan(rates[1, 0, 1])
    assert np.isnan(rates[1, 1, 0])


def test_where_more_multipliers_balance_the_gradients_exchange_rates_are_an_interval():
    gradients = np.array([[1.0, 0.0], [0.0, 1.0]])
    slopes = sparse.csr_array(np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]))
    at_a_corner = Constraints(unknowns=2, values=np.zeros(3), jacobian=slopes)
    ratios = weight_ratios(gradients, at_a_corner, np.array([0.5, 0.5]))
    assert ratios[0, 1] == pytest.approx([0.0, np.inf])
    apart = Constraints(unknowns=2, values=np.ones(3), jacobian=slopes)
    assert weight_ratios(np.array([[1.0, 0.0], [-3.0, 0.0]]), apart, np.array([0.75, 0.25]))[0, 1] == pytest.approx(
        [3, 3]
    )


def test_the_ends_of_an_interval_are_those_of_the_dual_set():
    # λ₁ + λ₂ = μ₁ + μ₂ and λ₁ = 2 μ₁ + μ₂ / 2: λ₁ / λ₂ is at least 1 (μ₁ = 0), and unbounded (μ₂ = 0 needs λ₂ < 0).
    gradients = np.array([[1.0, 1.0], [1.0, 0.0]])
    slopes = sparse.csr_array(np.array([[1.0, 2.0], [1.0, 0.5]]))
    ratios = weight_ratios(
        gradients, Constraints(unknowns=2, values=np.zeros(2), jacobian=slopes), np.array([0.6, 0.4])
    )
    assert ratios[0, 1, 0] == pytest.approx(1.0, abs=1e-5)


def test_a_kink_that_keeps_a_motion_from_being_certified_is_named():
    path, arm = tringali_2020.straight(11), pk.arms.tringali_3r()
    plain = pk.Tracking(arm, path, objectives=[pk.kinetic_energy], bases=1, differences="backward")
    q = np.array(plain.decode(np.atleast_2d((plain.xl + plain.xu) / 2)).q)
    ends = np.abs(q[0, 5, 1]), 2.0 * np.abs(q).max()  # reached by the joint at a sample, and never
    for end, named in zip(ends, (True, False), strict=True):

        def saturated(motion, end=end):
            return np.clip(motion.q[..., 1], -end, end) ** 2

        effort = pk.objective(unit="rad²s", form="integral", maximise=True)(saturated)
        task = pk.Tracking(arm, path, objectives=[effort], bases=1, differences="backward").task
        (reason,) = certify_motions(task, q, np.ones(1)).reason
        assert ("on one side of a kink of saturated" in reason) == named
        assert reason.startswith("criticality")

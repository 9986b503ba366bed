"""Whole fronts and peers: the design, the budgets, the indicators, the statistics."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from studies.benchmarks.fronts import __main__ as study
from studies.benchmarks.fronts import methods, sweeps
from studies.benchmarks.peers.programs import joint_program

CASE = "energy_torque"
EVALUATIONS = methods.Budget(kind="evaluations", amount=260)


@pytest.fixture(scope="module", autouse=True)
def _small():
    """Make the populations and the problem small: 21 samples, 20 individuals."""
    arm, path = pk.arms.tringali_3r(), pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=21)
    limits = pk.Limits(position=np.deg2rad([90.0, 120.0, 120.0]), velocity=3.8)

    def make():
        return pk.Tracking(
            arm,
            path,
            objectives=[pk.kinetic_energy, pk.torque_norm],
            limits=limits,
            coefficients=8,
            bases=3,
            differences="backward",
        )

    with pytest.MonkeyPatch.context() as patch:
        for module in (methods, study):
            patch.setattr(module, "POPULATION", 20)
        patch.setitem(methods.CASES, CASE, methods.Case(name=CASE, make=make, staged=True))
        patch.setattr(study, "_warm_up", lambda *_: None)
        methods.problem_of.cache_clear()
        sweeps.peer_of.cache_clear()
        yield
    methods.problem_of.cache_clear()
    sweeps.peer_of.cache_clear()


def table(**level):
    """Return scores of the cells: the hypervolume is the sum of the levels of a cell's factors."""
    noise = np.random.default_rng(0).normal(0.0, 0.01, 11)
    scores = {}
    for name, cell in methods.CELLS.items():
        has = {"MaxiMin": cell.maximin, "seeding": cell.seeded, "refinement": cell.refined}
        value = 0.5 + sum(worth for factor, worth in level.items() if has[factor])
        scores[name] = [{"hypervolume": value + n, "IGD+": 1 - value - n, "epsilon": 1.0} for n in noise]
    return scores


def test_a_factor_s_effect_is_what_was_put_in_and_the_others_none():
    rows = study.effect_rows("case", table(MaxiMin=0.1, seeding=0.0, refinement=-0.2))
    assert [row.column for row in rows] == list(methods.FACTORS)
    assert [row.ours for row in rows] == pytest.approx([0.1, 0.0, -0.2], abs=1e-12)
    assert [row.note.split()[0] for row in rows] == ["helps", "undecided", "HURTS"]


@pytest.mark.parametrize("name", study.methods_of(CASE))
def test_no_method_spends_more_evaluations_than_it_has_nor_much_less(name):
    done = study.run(CASE, name, 0, EVALUATIONS, 260)
    assert 0.6 * EVALUATIONS.amount <= done.evaluations + done.iterations <= EVALUATIONS.amount
    assert (done.iterations > 0) == (
        name in (study.OURS, study.EPSILON, sweeps.FATROP, sweeps.IPOPT) or name.endswith("refined")
    )
    assert len(done.F) <= methods.POPULATION


def test_points_that_the_verifier_refuses_are_absent():
    problem = methods.problem_of(CASE)
    account = methods.Account(budget=EVALUATIONS)
    q = problem.decode(methods.first_genes(problem, 0)).q
    motions = problem.task.motion(q)
    bad = (motions.tracking_error.max(axis=-1) > methods.OFF_PATH) | (
        problem.task.violations(motions).max(axis=-1) > methods.VIOLATION
    )
    good = q[~bad]
    assert len(good) > 0
    off = good.copy()
    off[:, 5] += 1e-3
    judged = methods.verify(problem, np.concatenate([good, off]), account)
    assert judged.failed == len(off)
    np.testing.assert_array_equal(judged.F, methods.verify(problem, good, account).F)


@pytest.mark.usefixtures("unchecked")  # our kernels get CasADi's symbols
@pytest.mark.parametrize("cyclic", [False, True])
def test_the_general_program_s_optimum_is_ours(cyclic):
    path = (
        pk.circle([0.42, 0.0], 0.05, duration=1.0, samples=21)
        if cyclic
        else methods.problem_of(CASE).task.tasks[0].path
    )
    limits = pk.Limits(position=np.deg2rad([90.0, 120.0, 120.0]), velocity=3.8)
    both = [pk.kinetic_energy, pk.torque_norm]
    problem = pk.Tracking(
        pk.arms.tringali_3r(),
        path,
        objectives=both,
        limits=limits,
        cyclic=cyclic,
        coefficients=8,
        bases=3,
        differences="backward",
    )
    task, ranges, free = problem.task, np.array([0.04, 0.1]), np.full(2, np.inf)
    starts = problem.decode(problem.sample_starts(5, np.random.default_rng(0))).q
    ours = sweeps.our_solver(problem)(ranges)
    theirs = sweeps.their_solver(joint_program(task))(ranges)
    for main in range(2):
        ends = ((start, theirs(start, main, free, False)[0]) for start in starts)
        start, other = next((start, end) for start, end in ends if end is not None)
        mine, _ = ours(start, main, free, False)
        values = [float(task.objectives[main](task.motion(q))) for q in (mine, other)]
        assert values[0] == pytest.approx(values[1], rel=1e-3)
        assert task.motion(other).tracking_error.max() < methods.OFF_PATH
        assert task.violations(task.motion(other)).max() < methods.VIOLATION

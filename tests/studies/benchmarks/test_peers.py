"""Peers' programs: the same problem as ours, exact derivatives by blocks, the same optimum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

casadi = pytest.importorskip("casadi")

import paretoik as pk  # noqa: E402
from paretoik.task.random_starts import rollout_starts  # noqa: E402
from studies.benchmarks.basins import all_cases  # noqa: E402
from studies.benchmarks.peers.programs import joint_program, staged_program  # noqa: E402
from studies.benchmarks.peers.solvers import COMPILER, Settings, blockwise, compiled, state  # noqa: E402
from studies.benchmarks.planner import simulations  # noqa: E402
from studies.benchmarks.planner.questions import Question, peer, task_of, tracking  # noqa: E402

pytestmark = pytest.mark.usefixtures("unchecked")  # our kernels get CasADi's symbols
SOLVERS = ("fatrop", "ipopt")
FEW = 26
TIGHT = Settings(barrier=1e-8, push=1e-9, tolerance=1e-12)
FORMS = [("simulation_4", 0), ("simulation_5", 0), ("energy_torque", None)]


def at(program, x, weights):
    """Return objective and rows of a program at unknowns."""
    said = state(program, casadi.SX)
    function = casadi.Function("said", [said["x"], said["p"]], [said["f"], said["g"]])
    value, rows = function(x, np.append(weights, np.ones(len(weights))))
    return float(value), np.asarray(rows).ravel()


@pytest.mark.parametrize("masses", ["printed", "fitted"])
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", simulations.NAMES)
def test_a_peer_s_objective_and_violations_are_ours_at_any_motion(name, solver, masses):
    question = Question(solver=solver, problem=name, samples=FEW, masses=masses)
    task, program = task_of(question), peer(question)
    q = np.cumsum(np.random.default_rng(4).normal(0.0, 0.1, (FEW, 3)), axis=0)
    q[-1] = q[0] if task.cyclic else q[-1]
    motion, x = task.motion(q), program.pack(q, np.ones(1))
    np.testing.assert_allclose(program.unpack(x), q)
    value, rows = at(program, x, [1.0])
    assert value == pytest.approx(float(task.objectives[0](motion)), rel=1e-10)
    lower, upper = program.row_bounds
    equal = lower == upper
    assert np.abs(rows - lower)[equal].max() == pytest.approx(motion.tracking_error.max(), rel=0.6)  # ours: √(x² + y²)
    above = np.concatenate([np.maximum(rows - upper, lower - rows)[~equal], *(x - program.bounds)[::-1] * [[1], [-1]]])
    ranges = [np.ptp(bounds, axis=-1).max() for bounds in task.bounds.values()] or [1.0]
    worst = float(task.violations(motion).max(initial=-1.0))
    assert (above.max() > 1e-12) == (worst > 0)
    assert not worst > 0 or worst * min(ranges) / 2 <= above.max() <= worst * max(ranges) * 2


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(("name", "main"), FORMS)
def test_a_hessian_of_blocks_is_casadis_own(solver, name, main):
    program = peer(Question(solver=solver, problem=name, samples=FEW, main=main))
    own = program.build().get_function("nlp_hess_l")
    rng = np.random.default_rng(7)
    point = [casadi.DM(np.abs(rng.normal(size=own.size_in(i)))) for i in range(own.n_in())]
    for mine, theirs in zip(blockwise(program, own).call(point), own.call(point), strict=True):
        assert np.abs(np.asarray(theirs)).max() > 0.1
        np.testing.assert_allclose(np.asarray(mine), np.asarray(theirs), rtol=1e-9, atol=1e-9)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("solver", SOLVERS)
def test_compiled_peers_take_the_same_steps(solver, tmp_path):
    program = peer(Question(solver=solver, problem="energy_torque", samples=FEW))
    start = pk.plan(tracking("simulation_2"), starts=4).best.motion.q[::4]
    ends = [
        each.solve(start, ceilings=np.array([np.inf, 0.07])) for each in (program, compiled(program, solver, tmp_path))
    ]
    assert ends[0].iterations > 3
    assert (ends[1].iterations, ends[1].solved) == (ends[0].iterations, True)
    np.testing.assert_allclose(ends[1].q, ends[0].q, atol=1e-8)


@pytest.mark.parametrize("solver", SOLVERS)
def test_from_our_optimum_peers_end_where_it_is_and_ceilings_bind(solver):
    best = pk.plan(tracking("simulation_2"), starts=8).best
    ended = peer(Question(solver=solver, problem="simulation_2")).solve(best.motion.q, settings=TIGHT)
    assert ended.solved
    assert ended.value == pytest.approx(best.objective, rel=1e-9)
    np.testing.assert_allclose(ended.q, best.motion.q, atol=1e-4)
    both = peer(Question(solver=solver, problem="energy_torque"))
    torque = 0.97 * float(pk.torque_norm(best.motion))
    capped = both.solve(best.motion.q, ceilings=np.array([np.inf, torque]), settings=TIGHT)
    assert capped.solved
    assert capped.value > best.objective
    assert float(pk.torque_norm(both.task.motion(capped.q))) == pytest.approx(torque, rel=1e-7)


@pytest.mark.parametrize(("arm", "cyclic"), [("planar 4R", False), ("rail", True)])
def test_a_peer_minimises_the_same_peak(arm, cyclic):
    cases = [case for case in all_cases(0) if case.objective.form == "peak"]
    case = replace(next(case for case in cases if case.arm == arm), cyclic=cyclic, objective=pk.peak_torque)
    task = case.problem().task
    (q,) = rollout_starts(task, 4, np.random.default_rng(0))[:1]
    program = joint_program(task)
    x, peak = program.pack(q, np.ones(1)), float(pk.peak_torque(task.motion(q)))
    np.testing.assert_array_equal(program.unpack(x), q)
    for top, holds in ((peak * (1 + 1e-6), True), (peak * (1 - 1e-6), False)):
        x[-1] = top
        assert (at(program, x, [1.0])[1] >= program.row_bounds[0] - 1e-9).all() == holds


@pytest.mark.parametrize("make", [joint_program, staged_program])
def test_a_spatial_arm_has_the_objective_that_our_function_gives(make):
    case = next(case for case in all_cases(0) if case.arm == "UR10" and not case.cyclic)
    task = replace(case.problem().task.resample(6), objectives=(pk.torque_norm, pk.kinetic_energy))
    (q,) = rollout_starts(task, 4, np.random.default_rng(0))[:1]
    program = make(task)
    values = [at(program, program.pack(q, np.ones(2)), weights)[0] for weights in np.eye(2)]
    np.testing.assert_allclose(values, [float(each(task.motion(q))) for each in task.objectives], rtol=1e-9)

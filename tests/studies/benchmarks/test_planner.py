"""The planner against FATROP and IPOPT: they solve our problem, evaluated or compiled, and losses come first."""

from __future__ import annotations

from functools import partial

import casadi
import numpy as np
import pytest

import paretoik as pk
from paretoik.trajectory.grid_oracle import grid_oracle
from studies.benchmarks.planner import optima, simulations
from studies.benchmarks.planner.compiling import COMPILER, blockwise, compiled
from studies.benchmarks.planner.cores import Cores
from studies.benchmarks.planner.optima import AGREED, TIGHT
from studies.benchmarks.planner.peers import Peer, Question, peer, program_of, task_of, tracking, written_out
from studies.benchmarks.planner.programs import ENERGY, TORQUE, inertia
from studies.benchmarks.planner.simulations import NAMES

SOLVERS = ("fatrop", "ipopt")
ARMS = ("printed", "fitted")
FEW = 26


def motions(name, masses="printed", count=3):
    """Return a task and random motions of it, not on its path."""
    task = task_of(name, masses, FEW)
    q = np.cumsum(np.random.default_rng(4).normal(0.0, 0.1, (count, FEW, 3)), axis=1)
    if task.cyclic:
        q[:, -1] = q[:, 0]
    return task, q


def written(question, masses, q):
    """Return the values of a peer's program at joint angles: objective and rows."""
    problem = written_out(program_of(question))
    function = casadi.Function("said", [problem["x"], problem["p"]], [problem["f"], problem["g"]])
    value, rows = function(peer(question).start(q, masses), inertia(masses))
    return float(value), np.asarray(rows).ravel()


def wanted(question, task, q):
    """Return the rows from paretoik's own values, in the peer's order."""
    motion, rows = task.motion(q), []
    last = len(q) - 1
    for k in range(len(q)):
        tracked = [motion.tool[k, :2]] if not (task.cyclic and k == last) else []
        ahead = k + 1 if question.solver == "fatrop" else k
        limits = {"velocity": motion.dq, "torque": motion.torque, "power": motion.torque * motion.dq}
        kinds = [kind for kind in limits if kind in task.bounds]
        if question.solver == "fatrop":
            rated = TORQUE in (question.main, question.capped) or task.objectives[0].name == TORQUE
            gaps = 3 + 3 * rated + 3 * task.cyclic + bool(question.capped)
            tied = [np.zeros(3)] if task.cyclic and k in (0, last) else []
            kinds = [kind for kind in kinds if kind != "velocity"]  # bounds of x
            tracked = ([np.zeros(gaps)] if k < last else []) + tracked + tied
        inside = 0 < ahead <= last
        rows += [*tracked, *(limits[kind][ahead] for kind in kinds if inside)]
    return np.concatenate(rows)


@pytest.mark.parametrize("masses", ARMS)
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", NAMES)
def test_a_peers_objective_and_rows_are_ours_at_any_motion(name, solver, masses):
    task, starts = motions(name, masses)
    question = Question(solver=solver, problem=name, samples=FEW)
    for q in starts:
        value, rows = written(question, masses, q)
        assert value == pytest.approx(float(task.objectives[0](task.motion(q))), rel=1e-10)
        np.testing.assert_allclose(rows, wanted(question, task, q), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(("main", "capped"), [(ENERGY, TORQUE), (TORQUE, ENERGY)])
def test_a_ceiling_bounds_the_other_objective(solver, main, capped):
    task, starts = motions("energy_torque")
    question = Question(solver=solver, problem="energy_torque", samples=FEW, main=main, capped=capped)
    both = {objective.name: objective for objective in task.objectives}
    for q in starts:
        value, rows = written(question, "printed", q)
        program = program_of(question)
        x = peer(question).start(q, "printed")
        other = x[program.sum_at[-1]] if solver == "fatrop" else rows[-1]
        rows = rows if solver == "fatrop" else rows[:-1]
        assert value == pytest.approx(float(both[main](task.motion(q))), rel=1e-10)
        assert other == pytest.approx(float(both[capped](task.motion(q))), rel=1e-10)
        np.testing.assert_allclose(rows, wanted(question, task, q), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("masses", ARMS)
@pytest.mark.parametrize("name", NAMES[:2])
def test_from_our_optimum_peers_end_where_it_is(name, masses):
    best = pk.plan(tracking(name, masses), starts=8).best
    for solver in SOLVERS:
        ended = Peer(Question(solver=solver, problem=name, samples=101), TIGHT).solve(best.motion.q, masses)
        assert ended.solved
        assert ended.value == pytest.approx(best.objective, rel=1e-9)
        np.testing.assert_allclose(ended.q, best.motion.q, atol=1e-4)


FORMS = [("simulation_4", ""), ("simulation_5", ""), ("energy_torque", TORQUE)]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(("name", "capped"), FORMS)
def test_a_hessian_of_blocks_is_casadis_own(solver, name, capped):
    question = Question(solver=solver, problem=name, samples=FEW, capped=capped)
    own = peer(question).solver.get_function("nlp_hess_l")
    rng = np.random.default_rng(7)
    at = [casadi.DM(rng.normal(size=own.size_in(i))) for i in range(own.n_in())]
    for mine, theirs in zip(blockwise(program_of(question), own).call(at), own.call(at), strict=True):
        assert np.abs(np.asarray(theirs)).max() > 0.1
        np.testing.assert_allclose(np.asarray(mine), np.asarray(theirs), rtol=1e-9, atol=1e-9)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize(("name", "capped", "solver"), [(*FORMS[0], "fatrop"), (*FORMS[2], "ipopt")])
def test_compiled_peers_take_the_same_steps(solver, name, capped, tmp_path):
    question = Question(solver=solver, problem=name, samples=FEW, capped=capped)
    again, seconds = compiled(question, tmp_path)
    start = pk.plan(tracking("simulation_2"), starts=4).best.motion.q[::4]
    cap = 0.07 if capped else np.inf
    one, other = (Peer(asked, ()).solve(start, "printed", cap) for asked in (question, again))
    assert seconds > 0
    assert one.iterations > 3
    assert (other.iterations, other.solved) == (one.iterations, True)
    np.testing.assert_allclose(other.q, one.q, atol=1e-8)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_ceiling_holds_and_binds(solver):
    task = task_of("energy_torque", "printed", FEW)
    start = pk.plan(tracking("simulation_2"), starts=4).best.motion.q[::4]
    energy, torque = (float(objective(task.motion(start))) for objective in task.objectives)
    question = Question(solver=solver, problem="energy_torque", samples=FEW, capped=TORQUE)
    ended = Peer(question, TIGHT).solve(start, cap=0.97 * torque)
    assert ended.solved
    assert ended.value > energy
    assert float(task.objectives[1](task.motion(ended.q))) == pytest.approx(0.97 * torque, rel=1e-7)


@pytest.mark.usefixtures("unchecked")  # whole plans and a grid oracle
def test_a_simulation_is_compared_with_its_peers_on_both_cores(monkeypatch, tmp_path):
    monkeypatch.setattr(simulations, "COMPILER", None)  # compiled forms are tested above
    monkeypatch.setattr(
        simulations, "BEGINNINGS", simulations.BEGINNINGS[1:2]
    )  # building a peer takes seconds for each
    monkeypatch.setattr(simulations, "WARMS", simulations.WARMS[:1])
    monkeypatch.setattr(optima, "grid_oracle", partial(grid_oracle, resolution=0.06))
    effort = simulations.Effort(starts=4, repeats=1)
    _, starts = motions("simulation_1", count=3)
    question = Question(solver="fatrop", problem="simulation_1", samples=FEW)
    alone = [peer(question).solve(q).value for q in starts]
    with Cores() as cores:
        assert [one.value for one in cores.solve(question, (), "printed", starts)] == alone  # in order
        peers = simulations.forms(cores, "simulation_1", effort, tmp_path)
        result = simulations.compare_simulation(cores, "simulation_1", "fitted", peers, effort)
    assert set(result.theirs) == {one.name for one in peers} == {"FATROP", "IPOPT"}
    agreed = [row.ours for row in result.rows if row.table == "optima of one basin"]
    assert len(agreed) == 2
    assert max(agreed) < AGREED
    assert all(row.ours > 0 for row in result.rows)

"""MaxiMin and its peers: the problems, the runs, the goals and their rows."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from pymoo.optimize import minimize

from studies.benchmarks.maximin import __main__ as study
from studies.benchmarks.maximin import cases, interleaved_runs, judging, methods, single_run, stored_runs
from studies.benchmarks.significance import compare, decide

ONE_OF_EACH = ["ZDT5", "DTLZ1-5", "WFG9", "MW14", "CTP8", "DASCMOP9", "OSY", "steep tail"]


def values(centre, seed):
    return centre * np.random.default_rng(seed).uniform(0.99, 1.01, 31)


def judged(**outcomes):
    """Return judged results, one keyword per problem: our indicator against 1 of both peers, our time against 1 s."""
    rows, seconds = [], {}
    for name, (ours, time) in outcomes.items():
        for peer in (methods.CROWDING, methods.HYPERVOLUME):
            rows.append(compare(name, "hypervolume", peer, values(ours, 0), values(1.0, 1)))
            seconds |= {(name, methods.OURS): time, (name, peer): 1.0}
    return judging.Judged(comparisons={methods.OURS: decide(rows)}, seconds=seconds)


@pytest.mark.parametrize("name", ONE_OF_EACH)
@pytest.mark.usefixtures("unchecked")  # beartype refuses nested tuples of floats where NumPy's ArrayLike is asked
def test_every_method_runs_on_every_kind_of_problem_with_as_many_evaluations(name):
    case, problem = cases.cases()[name], cases.problem_of(name)
    assert (problem.n_obj, problem.has_constraints()) == (case.n_obj, case.constrained)
    evaluated = []
    first = methods.first_genes(problem, case, 3)
    for method in set(methods.methods_of(case)) - {"AGE-MOEA"}:  # AGE-MOEA takes 10 s to compile
        algorithm = methods.algorithm(method, case, problem, first)
        result = minimize(problem, algorithm, ("n_eval", 2 * len(first)), seed=3)
        evaluated.append(result.algorithm.evaluator.n_eval)
    assert evaluated == [2 * interleaved_runs.POPULATION[case.n_obj]] * len(evaluated)


@pytest.mark.skipif(not cases.COCO, reason="coco-experiment is not installed")
def test_the_first_of_coco_s_problems_is_two_spheres():
    problem = cases.problem_of("bbob-biobj f01")
    rng = np.random.default_rng(0)
    x, step = rng.uniform(-4.0, 4.0, size=(2, problem.n_var))
    F = problem.evaluate(np.array([x - step, x, x + step]))
    np.testing.assert_allclose(F[0] - 2 * F[1] + F[2], 2 * step @ step)


@pytest.mark.usefixtures("unchecked")
def test_a_run_is_the_same_again_and_leaves_only_points_of_its_box_none_dominated():
    first, again = (single_run.run_once("steep tail", methods.BOXED, 1, 12) for _ in range(2))
    assert len(first.F) > 1
    assert np.array_equal(first.F, again.F)
    assert np.less_equal(first.F, cases.cases()["steep tail"].box[1]).all()
    assert np.array_equal(np.all(first.F[:, None] <= first.F[None], axis=-1), np.eye(len(first.F), dtype=bool))


def test_goals_need_no_loss_and_the_lead_on_half_of_the_problems_in_no_more_time():
    chosen = [cases.cases()[name] for name in ("ZDT1", "ZDT2", "ZDT3", "ZDT4")]
    good = judging.goal_rows(judged(ZDT1=(1.1, 0.5), ZDT2=(1.1, 1.0), ZDT3=(1.1, 1.5), ZDT4=(1.0, 0.5)), chosen)
    assert [row.ours for row in good] == [0, pytest.approx(0.5, abs=0.26)]
    assert all(row.note.startswith("met") for row in good)
    bad = judging.goal_rows(judged(ZDT1=(0.9, 0.5), ZDT2=(1.1, 1.5), ZDT3=(1.1, 1.5), ZDT4=(1.1, 0.5)), chosen)
    assert [(row.ours, row.reference) for row in bad] == [(1, 0), (0.25, 0.5)]
    assert bad[0].note == "NOT MET: of 4 comparisons 3 won, 0 undecided; ZDT1 hypervolume: loss"
    assert bad[1].note.startswith("NOT MET: 1 of 4; significantly ahead in 3, behind in 1; 0.50 to 1.50 of its time")


def test_too_few_seeds_prove_no_goal():
    one = compare("ZDT1", "hypervolume", methods.CROWDING, np.array([1.1, 1.2]), np.array([1.0, 0.9]))
    few = judging.Judged(comparisons={methods.OURS: decide([one])}, seconds={})
    (goal,) = judging.goal_rows(few, [cases.cases()["ZDT1"]])
    assert goal.note == "UNDECIDED: of 1 comparisons 0 won, 1 undecided"


def test_unions_are_stored_and_joined_with_what_was_stored(tmp_path):
    case = cases.cases()["steep tail"]
    one, other = (single_run.Run(np.array([F]), 1.0) for F in ([0.0, 1.0], [1.0, 0.0]))
    judging.union_front(case, [one], tmp_path)
    assert judging.union_front(case, [other], tmp_path).tolist() == [[1.0, 0.0], [0.0, 1.0]]


def test_an_unknown_problem_is_refused_by_name_and_families_are_taken():
    with pytest.raises(SystemExit, match=r"--problems must be some of ZDT, .*such as ZDT1, got ZDT9"):
        study.choose_cases(["ZDT9"], quick=False)
    assert [case.name for case in study.choose_cases(["OSY", "CTP"], quick=False)] == [
        *(f"CTP{k}" for k in range(1, 9)),
        "OSY",
    ]


def test_quick_shortens_every_problem():
    full = cases.cases()
    chosen = study.choose_cases([], quick=True)
    assert [case.name for case in chosen] == list(study.QUICK)
    assert all(case.generations < full[case.name].generations for case in chosen)


@pytest.mark.usefixtures("here")
def test_every_method_s_cost_and_every_comparison_are_reported(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(single_run, "WARM_UP", {2: "ZDT1"})
    monkeypatch.setattr(study, "QUICK", {"ZDT1": 3, "BNH": 3})
    monkeypatch.setattr(methods, "PEERS", ("NSGA-II", "SMS-EMOA"))
    file = tmp_path / "maximin.json"
    study.main(["--quick", "--seeds", "2", "--json", str(file)])
    rows = json.loads(file.read_text())
    costs = [(row["row"], row["column"]) for row in rows if row["table"] == judging.COST]
    assert costs == [(case, name) for case in ("ZDT1", "BNH") for name in methods.methods_of(cases.cases()[case])]
    for own, others in ((methods.OURS, 3), (methods.ONE_LINE, 2)):  # the first is compared with the second too
        compared = [row for row in rows if row["table"] == judging.TABLE.format(own)]
        assert len(compared) == 2 * others * 3  # problems and indicators
    assert [row["table"] for row in rows[-4:]] == [judging.GOALS] * 4
    assert "left out: MOEA/D" in capsys.readouterr().out


def test_with_goals_only_their_peers_run():
    case = replace(cases.cases()["ZDT1"], peers=(methods.CROWDING, methods.HYPERVOLUME))
    assert methods.methods_of(case) == [methods.OURS, methods.ONE_LINE, methods.CROWDING, methods.HYPERVOLUME]
    many = replace(cases.cases()["DTLZ2-5"], peers=case.peers)
    assert methods.methods_of(many) == [methods.OURS, methods.ONE_LINE, methods.CROWDING]


@pytest.mark.usefixtures("here")
def test_stored_runs_are_read_and_only_what_is_missing_is_run(tmp_path, monkeypatch):
    monkeypatch.setattr(single_run, "WARM_UP", {2: "ZDT1"})
    monkeypatch.setattr(study, "QUICK", {"ZDT1": 3})
    asked = ["--quick", "--goals", "--runs", str(tmp_path / "runs"), "--json", str(tmp_path / "rows.json")]
    study.main([*asked, "--seeds", "2"])
    files = {file: file.stat().st_mtime_ns for file in (tmp_path / "runs").rglob("*.npz")}
    rows = (tmp_path / "rows.json").read_text()
    study.main([*asked, "--seeds", "2"])
    assert (tmp_path / "rows.json").read_text() == rows
    study.main([*asked, "--seeds", "3"])
    after = {file: file.stat().st_mtime_ns for file in (tmp_path / "runs").rglob("*.npz")}
    assert len(files) == 2 * 4
    assert len(after) == 3 * 4
    assert files.items() <= after.items()


def test_a_run_of_ours_is_stored_for_this_search_and_one_of_a_peer_for_this_pymoo(tmp_path):
    ours, one_line, peer = (
        stored_runs.stored_run(tmp_path, "ZDT1", name, 3, 250) for name in (methods.OURS, methods.ONE_LINE, "NSGA-II")
    )
    assert ours.parts[-3] == one_line.parts[-3] != peer.parts[-3]
    assert len({ours, one_line, peer}) == 3
    assert stored_runs.load_run(ours) is None
    stored_runs.save_run(ours, single_run.Run(np.array([[0.0, 1.0]]), 0.25))
    stored = stored_runs.load_run(ours)
    assert stored.F.tolist() == [[0.0, 1.0]]
    assert stored.seconds == 0.25
    assert [file.name for file in ours.parent.iterdir()] == [ours.name]

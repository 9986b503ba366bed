"""MaxiMin and its peers: the problems, the runs, the goals and their rows."""

from __future__ import annotations

import json

import numpy as np
import pytest
from pymoo.optimize import minimize

from studies.benchmarks.maximin import __main__ as study
from studies.benchmarks.maximin import cases, judging, runs

ONE_OF_EACH = ["ZDT5", "DTLZ1-5", "WFG9", "MW14", "CTP8", "DASCMOP9", "OSY", "steep tail"]


@pytest.mark.parametrize("name", ONE_OF_EACH)
@pytest.mark.usefixtures("unchecked")  # beartype refuses nested tuples of floats where NumPy's ArrayLike is asked
def test_every_method_runs_on_every_kind_of_problem_with_as_many_evaluations(name):
    case, problem = cases.cases()[name], cases.problem_of(name)
    assert (problem.n_obj, problem.has_constraints()) == (case.n_obj, case.constrained)
    evaluated = []
    first = runs.first_genes(problem, case, 3)
    for method in set(runs.methods_of(case)) - {"AGE-MOEA"}:  # AGE-MOEA takes 10 s to compile
        algorithm = runs.algorithm(method, case, problem, first)
        result = minimize(problem, algorithm, ("n_eval", 2 * len(first)), seed=3)
        evaluated.append(result.algorithm.evaluator.n_eval)
    assert evaluated == [2 * runs.POPULATION[case.n_obj]] * len(evaluated)


@pytest.mark.skipif(not cases.COCO, reason="coco-experiment is not installed")
def test_the_first_of_coco_s_problems_is_two_spheres():
    problem = cases.problem_of("bbob-biobj f01")
    rng = np.random.default_rng(0)
    x, step = rng.uniform(-4.0, 4.0, size=(2, problem.n_var))
    F = problem.evaluate(np.array([x - step, x, x + step]))
    np.testing.assert_allclose(F[0] - 2 * F[1] + F[2], 2 * step @ step)


@pytest.mark.usefixtures("unchecked")
def test_a_run_is_the_same_again_and_leaves_only_points_of_its_box_none_dominated():
    first, again = (runs.run_once("steep tail", runs.BOXED, 1, 12) for _ in range(2))
    assert len(first.F) > 1
    assert np.array_equal(first.F, again.F)
    assert np.less_equal(first.F, cases.cases()["steep tail"].box[1]).all()
    assert np.array_equal(np.all(first.F[:, None] <= first.F[None], axis=-1), np.eye(len(first.F), dtype=bool))


def test_an_unknown_problem_is_refused_by_name_and_families_are_taken():
    with pytest.raises(SystemExit, match=r"--problems must be some of ZDT, .*such as ZDT1, got ZDT9"):
        study.choose_cases(["ZDT9"], quick=False)
    assert [case.name for case in study.choose_cases(["OSY", "CTP"], quick=False)] == [
        *(f"CTP{k}" for k in range(1, 9)),
        "OSY",
    ]


@pytest.mark.usefixtures("here")
def test_every_method_s_cost_and_every_comparison_are_reported(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(runs, "WARM_UP", {2: "ZDT1"})
    monkeypatch.setattr(study, "QUICK", {"ZDT1": 3, "BNH": 3})
    monkeypatch.setattr(runs, "PEERS", ("NSGA-II", "SMS-EMOA"))
    file = tmp_path / "maximin.json"
    study.main(["--quick", "--seeds", "2", "--json", str(file)])
    rows = json.loads(file.read_text())
    costs = [(row["row"], row["column"]) for row in rows if row["table"] == judging.COST]
    assert costs == [(case, name) for case in ("ZDT1", "BNH") for name in runs.methods_of(cases.cases()[case])]
    for own, others in ((runs.OURS, 3), (runs.ONE_LINE, 2)):  # the first is compared with the second too
        compared = [row for row in rows if row["table"] == judging.TABLE.format(own)]
        assert len(compared) == 2 * others * 3  # problems and indicators
    assert [row["table"] for row in rows[-4:]] == [judging.GOALS] * 4
    assert "left out: MOEA/D" in capsys.readouterr().out


@pytest.mark.usefixtures("here")
def test_stored_runs_are_read_and_only_what_is_missing_is_run(tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "WARM_UP", {2: "ZDT1"})
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

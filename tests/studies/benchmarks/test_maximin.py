"""MaxiMin beside its peers: the runs and their rows."""

from __future__ import annotations

import numpy as np
import pytest
from rich.console import Console

from studies.benchmarks import maximin as study


def test_every_method_s_cost_is_reported():
    case = study.cases()["ZDT1"]
    runs = {("ZDT1", name): [study.Run(np.empty((0, 2)), t) for t in (1.0, 2.0, 9.0)] for name in study.peers(case)}
    rows = study.cost_rows(runs, [case])
    assert [row.column for row in rows] == study.peers(case)
    assert {(row.ours, row.unit, row.note) for row in rows} == {(2.0, "s", "25000 evaluations")}


@pytest.mark.usefixtures("unchecked")  # beartype refuses nested tuples of floats where NumPy's ArrayLike is asked
def test_a_run_is_the_same_again_and_leaves_only_points_of_its_box_none_dominated():
    first, again = (study.run("steep tail", study.BOXED, 1, 12) for _ in range(2))
    assert len(first.F) > 1
    assert np.array_equal(first.F, again.F)
    assert np.less_equal(first.F, study.cases()["steep tail"].box[1]).all()
    assert np.array_equal(np.all(first.F[:, None] <= first.F[None], axis=-1), np.eye(len(first.F), dtype=bool))


def test_an_unknown_problem_is_refused_by_name():
    with pytest.raises(SystemExit, match=r"ZDT1, .*got ZDT9"):
        study.choose_cases(["ZDT9"], quick=False, console=Console(quiet=True))


def test_quick_shortens_every_problem():
    full = study.cases()
    chosen = study.choose_cases([], quick=True, console=Console(quiet=True))
    assert [case.name for case in chosen] == list(study.QUICK)
    assert all(case.generations < full[case.name].generations for case in chosen)

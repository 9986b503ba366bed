"""MaxiMin beside its peers: the statistics that pronounce."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from studies.benchmarks import maximin as study

p_values = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12)


def values(centre, seed):
    return centre * np.random.default_rng(seed).uniform(0.99, 1.01, 31)


def test_holm_is_the_textbook_s():
    np.testing.assert_allclose(study.holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])


@given(p_values)
def test_holm_never_helps_and_keeps_the_order(p):
    corrected = study.holm(p)
    assert (corrected >= p).all()
    assert (corrected <= 1).all()
    assert (np.diff(corrected[np.argsort(p)]) >= 0).all()


@pytest.mark.parametrize("indicator", study.MARGIN)
def test_exchanging_the_sides_exchanges_the_verdict(indicator):
    ours, theirs = values(1.0, 0), values(1.5, 1)
    one, other = (study.compare("p", indicator, "peer", *sides) for sides in ((ours, theirs), (theirs, ours)))
    assert one.a12 + other.a12 == pytest.approx(1.0)
    assert one.ratio * other.ratio == pytest.approx(1.0)
    (first,), (second,) = study.judged([one]), study.judged([other])
    assert {first.verdict, second.verdict} == {"win", "loss"}
    assert (first.verdict == "win") == (indicator != "hypervolume")


def test_losses_come_first_and_equals_are_called_so():
    same = study.compare("same", "IGD+", "peer", values(1.0, 0), values(1.0, 1))
    won = study.compare("won", "IGD+", "peer", values(1.0, 0), values(2.0, 1))
    lost = study.compare("lost", "IGD+", "peer", values(2.0, 0), values(1.0, 1))
    found = study.judged([won, same, lost])
    assert [(one.problem, one.verdict) for one in found] == [("lost", "loss"), ("same", "equal"), ("won", "win")]


def test_a_comparison_is_reported_with_the_peer_beside_it_even_where_a_run_found_nothing():
    (one,) = study.judged([study.compare("ZDT1", "IGD+", "cd", np.full(5, np.inf), values(1.0, 0)[:5])])
    (row,) = study.comparison_rows([one])
    assert (row.row, row.column, row.ours, row.paper) == ("ZDT1", "IGD+ beside cd", np.inf, one.theirs)
    assert row.note.startswith(one.verdict)


def test_every_method_s_cost_is_reported():
    case = study.cases()["ZDT1"]
    runs = {("ZDT1", name): [study.Run(np.empty((0, 2)), t) for t in (1.0, 2.0, 9.0)] for name in study.peers(case)}
    rows = study.cost_rows(runs, [case])
    assert [row.column for row in rows] == study.peers(case)
    assert {(row.ours, row.unit, row.note) for row in rows} == {(2.0, "s", "25000 evaluations")}


def test_the_union_itself_scores_best_and_units_do_not_matter():
    x = np.linspace(0.0, 1.0, 20)
    union = np.column_stack((x, 1 - np.sqrt(x)))
    whole, part = study.scores(union, union), study.scores(union[5:15] + 0.01, union)
    assert (whole["IGD+"], whole["epsilon"]) == (0.0, 0.0)
    assert whole["hypervolume"] > part["hypervolume"]
    assert min(part["IGD+"], part["epsilon"]) > 0
    scale = np.array([1000.0, 0.01])
    assert study.scores((union[5:15] + 0.01) * scale, union * scale) == pytest.approx(part)
    assert study.scores(np.empty((0, 2)), union)["hypervolume"] == 0.0


@pytest.mark.usefixtures("unchecked")  # beartype refuses nested tuples of floats where NumPy's ArrayLike is asked
def test_a_run_is_the_same_again_and_leaves_only_points_of_its_box_none_dominated():
    first, again = (study.run("steep tail", study.BOXED, 1, 12) for _ in range(2))
    assert len(first.F) > 1
    assert np.array_equal(first.F, again.F)
    assert np.less_equal(first.F, study.cases()["steep tail"].box[1]).all()
    assert np.array_equal(np.all(first.F[:, None] <= first.F[None], axis=-1), np.eye(len(first.F), dtype=bool))


def test_an_unknown_problem_is_refused_by_name():
    with pytest.raises(SystemExit, match=r"ZDT1, .*got ZDT9"):
        study.wanted(["ZDT9"], quick=False, console=Console(quiet=True))


def test_quick_shortens_every_problem():
    full = study.cases()
    chosen = study.wanted([], quick=True, console=Console(quiet=True))
    assert [case.name for case in chosen] == list(study.QUICK)
    assert all(case.generations < full[case.name].generations for case in chosen)

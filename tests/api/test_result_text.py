"""Summaries: certificates and exchange rates as the command line prints them."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import paretoik as pk
from paretoik.api.load import load_front
from paretoik.api.result_text import choice_text, gap_text, result_text
from paretoik.cli import main
from problems import tringali_2020

MINE = """
from paretoik import Tracking, kinetic_energy, line, torque_norm
from paretoik.robot.arms import tringali_3r

def good() -> Tracking:
    path = line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=21)
    return Tracking(tringali_3r(), path, objectives=[kinetic_energy, torque_norm], coefficients=4, bases=2)
"""


@pytest.fixture(scope="module")
def front():
    goals = [pk.kinetic_energy, pk.torque_norm]
    return pk.epsilon_front(
        pk.Tracking(pk.arms.tringali_3r(), tringali_2020.straight(26), objectives=goals, differences="backward"),
        points=5,
        starts=6,
    )


def test_a_chosen_point_is_printed_with_its_certificate_and_its_exchange_rates(front):
    choice = front.select(pk.Weights(kinetic_energy=0.5, torque_norm=0.5))
    text = choice_text(front, choice)
    assert "certified: 1 minimum; criticality at most" in text
    printed = re.search(r"saving kinetic_energy costs (\S+) N²m²s of torque_norm per J s", " ".join(text.split()))
    rate = front.certificates.exchange_rates[choice.index, 0, 1]
    assert float(printed[1]) == pytest.approx(-rate, rel=1e-2)


def test_the_summary_names_the_solvers_and_how_many_points_a_convex_program_confirmed(front, tmp_path):
    entry = {"refinement": "interior-point", "criticality": "cvxpy, Clarabel", "confirmed": 5, "points": 5}
    assert front.provenance["solvers"] == entry
    text = " ".join(result_text(front, tmp_path).split())
    assert "refined by the interior-point method; 5 of 5 points confirmed as critical by a convex subproblem" in text


def test_jumps_and_what_further_points_could_add_are_printed(front):
    def jumping(*rows):
        high = np.isin(np.arange(4), rows)[:, None, None]
        between = SimpleNamespace(values_between=lambda one, shares: np.where(high, np.inf, one.minimised[:-1, None]))
        return replace(front, problem=between)

    share = f"further points could add about {100 * front.missing_hypervolume:.2g} % of the hypervolume"
    ids = front.ids.tolist()
    assert gap_text(jumping()) == share
    jump = f"jump to another branch of optima between points {ids[1]} and {ids[2]}"
    assert gap_text(jumping(1)) == f"{jump}\n{share}"
    assert f"jumps to another branch of optima between points {ids[0]} and {ids[1]}, {ids[2]} and" in gap_text(
        jumping(0, 2)
    )
    between = f"Between points {ids[1]} and {ids[2]} the front jumps to another branch of optima."
    for row, said in ((0, False), (1, True), (2, True), (3, False)):
        assert (between in jumping(1).choice(row, "").reason) == said
    assert gap_text(replace(front, certificates=None)) == ""


def test_a_refined_run_is_printed_stored_and_drawn_with_its_certificates(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "users_refined_problem.py").write_text(MINE)
    out = tmp_path / "run"
    problem = f"{tmp_path / 'users_refined_problem.py'}:good"

    def output(*words):
        monkeypatch.setattr(sys, "argv", ["paretoik", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        assert not ended.value.code
        return capsys.readouterr().out

    small = ("--population", "8", "--generations", "10", "--quiet", "--refine")
    said = output("solve", problem, "--out", out, *small)
    assert re.search(r"certified: \d+ minimum; criticality", said)
    assert re.search(r"further points could add about \S+ % of the hypervolume", said)
    assert (out / "certificates.png").stat().st_size > 1000
    chosen = json.loads(
        output("select", out, "--weights", "kinetic_energy=1", "--json", "--problem", problem),
        parse_constant=pytest.fail,
    )
    stored = load_front(out, problem)
    assert chosen["certificate"]["criticality"] == stored.certificates.criticality[0]

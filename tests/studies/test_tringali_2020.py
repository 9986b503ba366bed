"""The study of Tringali & Cocuzza 2020, compared with the paper."""

from __future__ import annotations

import csv
from dataclasses import dataclass

import numpy as np
import pytest

from paretoik.robot.arms import TRINGALI_MASSES
from problems import tringali_2020
from studies.reporting import REPORTED
from studies.tringali_2020 import __main__ as command
from studies.tringali_2020.masses import PLACES, Prototype
from studies.tringali_2020.published import SearchOptions, published_rows
from studies.tringali_2020.simulations import as_printed, paper, with_arm
from studies.tringali_2020.trade_off import sweep
from studies.tringali_2020.validation import bound_row

FEW = SearchOptions(configurations=4)


@dataclass
class Study:
    """The results of a short study."""

    rows: list
    simulations: dict
    falling: list
    trades: list

    def value(self, table, row, column, masses="fitted"):
        (number,) = [
            r.ours for r in self.rows if (r.table, r.row, r.column) == (f"{table}, {masses} masses", row, column)
        ]
        return number


@pytest.fixture(scope="module")
def study():
    """Study in short."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "bound_row", lambda simulation, **_: bound_row(simulation, resolution=0.06))
        patch.setattr(command, "published_rows", lambda one, executor: published_rows(one, options=FEW))
        return Study(*command.run_study(starts=12, points=3, candidates=300, seeds=2, rehearsed=False))


def reported():
    with (REPORTED / "tringali_2020.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_every_number_is_finite(study):
    assert [row for row in study.rows if not np.isfinite(row.ours)] == []


@pytest.mark.parametrize("masses", ["fitted", "printed"])
def test_every_number_of_the_paper_has_one_of_ours_in_the_same_unit(study, masses):
    ours = {(row.table, row.row, row.column, row.unit): row.reference for row in study.rows}
    missing = [
        line
        for line in reported()
        if ours.get((f"{line['table']}, {masses} masses", line["row"], line["column"], line["unit"]))
        != float(line["paper"])
    ]
    never_reached = {"torque at its limit from", "power at its limit until"} if masses == "printed" else set()
    assert {line["column"] for line in missing} == never_reached


@pytest.mark.parametrize(
    ("table", "row", "column"),
    [
        *[("Table 4", f"optimum {number}", "planner") for number in (1, 2, 3)],
        *[("Table 5", f"simulation {number}", "kinetic energy") for number in (1, 2, 3)],
        ("Table 6", "simulation 5", "kinetic energy"),
        *[("Table 5", f"simulation {number}", "torque norm") for number in (1, 2, 3, 4)],
        ("Table 6", "simulation 5", "torque norm"),
        ("Table 6", "simulation 5", "peak torque"),
        ("Table 6", "simulation 5", "peak power"),
    ],
)
def test_fitted_masses_bring_the_papers_numbers_within_a_percent_or_two(study, table, row, column):
    near = 0.0085 if (table, row, column) in PLACES else 0.02
    assert study.value(table, row, column) == pytest.approx(paper()[table, row, column], rel=near)


def test_as_printed_masses_give_a_quarter_less_energy_than_the_paper(study):
    for number in (1, 2):
        ours = study.value("Table 5", f"simulation {number}", "kinetic energy", "printed")
        assert 0.70 < ours / paper()["Table 5", f"simulation {number}", "kinetic energy"] < 0.76


def test_limits_never_help(study):
    for one in study.simulations.values():
        first, second, third, fourth, _ = (simulation.plan.best.objective for simulation in one)
        assert first <= second * (1 + 1e-9)
        assert third <= fourth * (1 + 1e-9)


def test_simulation_1_has_the_three_optima_of_the_paper_and_more(study):
    for masses in ("fitted", "printed"):
        assert study.value("Table 5", "simulation 1", "distinct optima", masses) > 3
        energies = [study.value("Table 4", f"optimum {number}", "planner", masses) for number in (1, 2, 3)]
        assert energies == sorted(energies)


def test_the_calculus_of_variations_starts_where_an_optimum_does_and_stays_near(study):
    for number in (1, 2, 3):
        planner, theirs = (study.value("Table 4", f"optimum {number}", by) for by in ("planner", "Nedungadi"))
        assert planner <= theirs < 1.03 * planner
        assert 0 < study.value("Table 4", f"optimum {number}", "mean |Δq|") < 0.03


def test_no_limit_is_used_beyond_all_of_it(study):
    used = [row for row in study.rows if row.column == "worst limit use"]
    assert len(used) == 8
    assert all(1 - 1e-6 < row.ours < 1 + 1e-7 for row in used)


def test_the_ends_of_the_front_are_the_best_of_simulations_2_and_3(study):
    for masses in ("fitted", "printed"):
        energy = study.value("Figure 14", "energy end", "kinetic energy", masses)
        torque = study.value("Figure 14", "torque end", "torque norm", masses)
        assert energy == pytest.approx(study.value("Table 5", "simulation 2", "kinetic energy", masses), rel=1e-5)
        assert torque == pytest.approx(study.value("Table 5", "simulation 3", "torque norm", masses), rel=1e-5)


def test_every_point_of_the_front_is_certified(study):
    for masses in ("fitted", "printed"):
        points = study.value("Figure 14", "front", "points", masses)
        assert study.value("Figure 14", "front", "certified minima", masses) == points >= 3
        assert study.value("Figure 14", "front", "worst criticality", masses) <= 1e-6
        assert study.value("Figure 14", "front", "worst violation", masses) <= 1e-8


def test_a_start_moved_a_little_along_the_self_motion_has_the_papers_difference(study):
    for number in (1, 2, 3):
        moved = study.value("Table 4", f"optimum {number}", "start moved for the paper's mean |Δq|")
        assert 0 < moved < 0.005


def test_the_line_of_the_text_is_a_little_longer_and_costs_a_little_more(study):
    assert study.value("Section 3.2", "line", "length") == pytest.approx(0.39977, abs=5e-6)
    for number, column in ((1, "kinetic energy"), (3, "torque norm")):
        shorter, longer = (study.value("Table 5", f"simulation {number}{by}", column) for by in ("", ", 0.40 m"))
        assert 1.001 < longer / shorter < 1.004
    path = tringali_2020.straight(length=0.4)
    assert np.linalg.norm(path.positions[-1] - path.positions[0]) == pytest.approx(0.4, rel=1e-12)


def test_the_published_search_finds_the_best_where_limits_leave_it_a_start(study):
    reached = {(row.row, row.column): row for row in study.rows if row.column.startswith("optima reached")}
    assert len(reached) == 9
    for number in (1, 2, 3, 4, 5):
        last = [row for (name, _), row in reached.items() if name == f"simulation {number}"][-1]
        assert last.ours >= 1
        assert "0.000 %" in last.note
    assert reached["simulation 3", "optima reached, k_JL = 0.01"].ours == 0
    assert "limits cannot all hold" in reached["simulation 3", "optima reached, k_JL = 0.01"].note


def test_epsilon_as_an_equality_holds_and_never_beats_the_inequality(study):
    alone = study.simulations["fitted"][1:3]
    task = with_arm(as_printed("energy_torque"), "fitted").task
    ends = np.array([[float(each(one.motion)) for each in task.objectives] for one in alone])
    starts = np.stack([one.motion.q for one in alone])
    below, equal = (sweep(task, starts, ends, levels=2, equality=equality).objectives for equality in (False, True))
    (level,) = np.linspace(ends[1, 1], ends[0, 1], 3)[1:2]
    assert below[0, 1] <= level + 1e-8
    assert equal[0, 1] == pytest.approx(level, rel=1e-7)
    assert below[0, 0] <= equal[0, 0] * (1 + 1e-7)


def test_fitted_masses_fit_and_each_of_them_matters():
    printed = np.array([paper()[place] for place in PLACES])
    prototype, fitted = Prototype(starts=12), np.array(TRINGALI_MASSES["fitted"])
    errors = np.abs(prototype.numbers(fitted) / printed - 1)
    assert errors.max() < 0.005
    for k in range(3):
        for factor in (0.85, 1.15):
            changed = fitted * np.where(np.arange(3) == k, factor, 1.0)
            assert np.abs(prototype.numbers(changed) / printed - 1).max() > 0.02

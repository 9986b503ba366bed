"""Tests of certified fronts: an honest front passes, one that was tampered with is detected."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import import_module

import jaxtyping
import numpy as np
import pytest

import paretoik as pk
from paretoik.task.motion_task import SAMPLES
from paretoik.trajectory.derivatives import linearise
from problems import tringali_2020
from studies.benchmarks.certified import __main__ as study
from studies.benchmarks.certified import cases
from studies.benchmarks.certified.cases import Case, certificate_rows, goal_row, subject_of
from studies.benchmarks.certified.dominating import (
    DOMINATED,
    SIZES,
    ipopt_attempt,
    ipopt_rows,
    objectives,
    perturbation_rows,
    perturbations,
    random_step,
    violation,
    within,
)
from studies.benchmarks.certified.exchange import STEPS, compare_rate, exchange_rows, pairs
from studies.benchmarks.certified.racing import race_rows, solve_by, solved_by_us
from studies.benchmarks.certified.recomputed import recomputed_difference
from studies.benchmarks.certified.splines import spline_program
from studies.benchmarks.planner.verdicts import LOSS
from tests.pareto.motions import certify_motions


def small():
    limits = pk.Limits(position=tringali_2020.POSITION, velocity=tringali_2020.VELOCITY)
    both = [pk.kinetic_energy, pk.torque_norm]
    return pk.Tracking(
        pk.arms.tringali_3r(), tringali_2020.straight(26), objectives=both, limits=limits, differences="backward"
    )


SMALL = Case(name="small", make=small, points=4, raced=True)


@pytest.fixture(scope="module")
def subject(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cases, "COMPILER", None)
        patch.setattr(jaxtyping.config, "jaxtyping_disable", True)
        return subject_of(SMALL, points=SMALL.points, seed=0, folder=tmp_path_factory.mktemp("none"))


def point_of(subject, q):
    """Return a subject with only this motion on its front, certified; ranges are those of the whole front."""
    F = np.array([[float(one(subject.task.motion(q))) for one in subject.task.objectives]])
    said = certify_motions(subject.task, q[None], subject.ranges)
    front = pk.Front(
        ids=np.zeros(1, dtype=int),
        objectives=F,
        names=subject.front.names,
        units=subject.front.units,
        maximised=subject.front.maximised,
        motions=subject.task.motion(q[None]),
        certificates=said,
    )
    return replace(subject, front=front)


@pytest.fixture(scope="module")
def middle(subject):
    return len(subject.q) // 2


@pytest.fixture(scope="module")
def honest(subject, middle):
    return point_of(subject, subject.q[middle])


@pytest.fixture(scope="module")
def spoiled(subject, middle):
    """Return the same point, moved along the self-motion by a hundredth of a radian."""
    at = linearise(subject.program, subject.q[middle])
    steps = within(at, random_step(at, 1e-2, np.random.default_rng(1)), level=False)
    assert steps is not None
    return point_of(subject, steps)


def test_an_honest_point_is_dominated_neither_by_ipopt_nor_by_random_steps(honest):
    for row in (*ipopt_rows(honest, barriers=("low", "high")), *perturbation_rows(honest, steps=100, seed=0)):
        assert row.ours <= DOMINATED
        assert not row.note.startswith(LOSS)


def test_a_point_that_was_moved_along_the_self_motion_is_dominated_by_both(spoiled):
    for row in (*ipopt_rows(spoiled, barriers=("low",)), *perturbation_rows(spoiled, steps=100, seed=0)):
        assert row.ours > 100 * DOMINATED
        assert row.note.startswith(LOSS)
        assert "1 points beaten, most: point 0" in row.note


def test_gains_by_ipopt_cost_no_other_objective(spoiled, monkeypatch):
    ended = []
    solve = type(spoiled.peer).solve

    def watched(*arguments, **settings):
        ended.append(solve(*arguments, **settings)[0])
        return ended[-1], 0

    monkeypatch.setattr(type(spoiled.peer), "solve", watched)
    attempt = ipopt_attempt(spoiled, 0, 0, warm=True)
    risen = (objectives(spoiled.task, ended[-1]) - spoiled.values[0]) / spoiled.ranges
    assert attempt.counts
    assert attempt.gain == pytest.approx(-risen.min(), rel=1e-6)
    assert risen.max() <= 1e-9


def test_ipopt_repeats_below_a_lower_ceiling_if_it_let_one_slip(honest, monkeypatch):
    """A peer exceeds its ceiling while that is the point's own."""
    asked = []
    better = honest.q[0]

    def solve(self, q, main, ceilings, ranges, *, warm):
        asked.append(ceilings[1])
        return (subject_end if len(asked) == 1 else better), 1

    at = linearise(honest.program, honest.q[0])
    steps = (within(at, random_step(at, 1e-4, np.random.default_rng(k)), level=False) for k in range(20))
    subject_end = next(q for q in steps if objectives(honest.task, q)[1] > honest.values[0, 1])
    monkeypatch.setattr(type(honest.peer), "solve", solve)
    attempt = ipopt_attempt(honest, 0, 0, warm=True)
    rise = objectives(honest.task, subject_end)[1] - honest.values[0, 1]
    assert asked == pytest.approx([honest.values[0, 1], honest.values[0, 1] - 2 * rise], rel=1e-12)
    assert attempt.counts
    assert attempt.gain == pytest.approx(0.0, abs=1e-11)


def test_random_steps_have_their_size_and_satisfy_path_and_limits(subject, middle):
    at = linearise(subject.program, subject.q[middle])
    assert subject.certificates.violation_between[middle] >= 0
    for k, size in enumerate(SIZES):
        step = random_step(at, size, np.random.default_rng(k))
        moved = at.displacement(step)
        assert np.sqrt(np.mean(np.sum(moved**2, axis=1))) == pytest.approx(size)
        assert np.abs(np.einsum("trj,tj->tr", at.path_jacobian, moved)).max() < 1e-12
    motions = perturbations(subject, middle, 40, np.random.default_rng(0))
    assert sum(one.counts for one in motions) > 20


def test_steps_that_leave_the_limits_are_bent_back(subject):
    """A limit is active at a point: half of all small steps would leave it."""
    held = next(p for p in range(len(subject.q)) if linearise(subject.program, subject.q[p]).inequalities.min() < 1e-6)
    at, rng, left = linearise(subject.program, subject.q[held]), np.random.default_rng(3), 0
    for _ in range(10):
        step = random_step(at, 1e-3, rng)
        motion = within(at, step, level=False)
        assert motion is not None
        assert violation(subject.task, motion) <= 1e-8
        left += violation(subject.task, subject.task.motion(at.x + at.displacement(step)).at(subject.task.times)) > 1e-8
    assert left >= 3


def test_level_steps_change_no_objective_to_first_order(subject, middle):
    at = linearise(subject.program, subject.q[middle])
    for level, order, sizes in ((False, 1, (1e-5, 1e-6)), (True, 2, (1e-3, 1e-4))):
        tries = (
            [within(at, random_step(at, size, np.random.default_rng(seed)), level=level) for size in sizes]
            for seed in range(20)
        )
        both = next(pair for pair in tries if all(one is not None for one in pair))  # other pairs leave the limits
        far, near = (
            np.abs((objectives(subject.task, one) - subject.values[middle]) / subject.ranges).max() for one in both
        )
        assert np.log10(far / near) == pytest.approx(order, abs=0.35)


def test_exchange_rates_agree_with_differences_and_wrong_ones_are_lost(subject):
    (row,) = exchange_rows(subject)
    assert row.ours < 1e-5
    assert not row.note.startswith(LOSS)
    certificates = subject.certificates
    wrong = replace(
        certificates,
        exchange_rates=1.01 * certificates.exchange_rates,
        exchange_intervals=1.01 * certificates.exchange_intervals,
    )
    (row,) = exchange_rows(replace(subject, front=replace(subject.front, certificates=wrong)))
    assert row.ours == pytest.approx(0.01, rel=0.05)
    assert row.note.startswith(LOSS)


def test_quotients_at_a_kink_are_compared_with_the_interval(subject):
    point, i, j = next(pairs(subject))
    quotient = compare_rate(subject, point, i, j)
    assert quotient is not None
    wide = replace(quotient, interval=quotient.rate * np.array([1.1, 0.9]))
    aside = replace(quotient, interval=quotient.rate * np.array([1.3, 1.2]))
    assert not wide.unique
    assert wide.off == 0.0
    assert aside.off == pytest.approx(0.2, rel=1e3 * STEPS[0])


def test_certificates_are_compared_with_the_goals(honest, spoiled):
    fine, poor = ({row.column: row for row in certificate_rows(one)} for one in (honest, spoiled))
    assert not any(row.note.startswith(LOSS) for row in fine.values())
    assert {column for column, row in poor.items() if row.note.startswith(LOSS)} == {
        "worst criticality",
        "not a minimum",
    }
    assert poor["not a minimum"].note == f"{LOSS}1 undetermined"


def test_a_missed_goal_and_a_nan_are_losses():
    notes = [goal_row("t", "r", "c", "", ours, 1.0, "said").note for ours in (1.0, 1.1, np.nan)]
    assert notes == ["said", f"{LOSS}said", f"{LOSS}said"]


def test_seconds_per_point_count_only_points_that_a_peer_reached(subject):
    rows = race_rows(subject)
    for name, peer, (better, median, every, *alone) in (
        ("IPOPT", subject.peer, rows[:5]),
        ("FATROP", subject.staged, rows[5:]),
    ):
        tries = [solve_by(peer, subject, point) for point in range(len(subject.q))]
        reached = sum(one.reached for one in tries)
        assert reached >= len(tries) / 2
        assert better.row == f"{name} from neighbours"
        assert median.ours == every.ours == pytest.approx(subject.seconds / len(tries))
        assert f"{name} " in median.note
        assert f"reaches {reached} of them" in median.note
        assert f"ours reach {sum(solved_by_us(subject, i).reached for i in range(len(tries)))} of" in alone[0].note
        assert all(row.ours > 0 for row in alone)


def test_a_motion_packed_for_fatrop_keeps_all_rows_and_gives_its_totals(subject):
    staged, q = subject.staged, subject.q[1]
    x, layout = staged.pack(q, subject.ranges), staged.layout
    assert x[-layout.sums :] == pytest.approx(subject.values[1] / subject.ranges, rel=1e-9)
    np.testing.assert_array_equal(np.stack([x[layout.posture(k)] for k in range(len(q))]), q)
    assert np.all((x >= staged.sides["lbx"] - 1e-9) & (x <= staged.sides["ubx"] + 1e-9))
    again, _ = staged.solve(q, 0, np.array([np.inf, subject.values[1, 1]]), subject.ranges, warm=True)
    assert np.abs(again - q).max() < 1e-3


def test_unreachable_points_are_not_reached_and_beaten_points_are_reported(subject):
    """Points are better, or worse, than any motion."""
    for share in (-0.5, 0.01):
        moved = replace(subject.front, objectives=subject.front.objectives + share * subject.ranges)
        better, median, every, *_ = race_rows(replace(subject, front=moved, staged=None))
        reached = int(median.note.split("reaches ")[1].split()[0])
        assert reached == 0 if share < 0 else reached >= len(subject.q) / 2
        assert (every.reference is None) == (share < 0)
        assert (better.ours > 1e-3) == (share > 0)


def test_quick_writes_strict_json_of_every_case(tmp_path, monkeypatch, subject, capsys):
    asked = []

    def stand_in(case, *, points, seed, folder):
        asked.append((case.name, points, seed))
        return replace(subject, name=case.name)

    monkeypatch.setattr(study, "subject_of", stand_in)
    monkeypatch.setattr(study, "QUICK_STEPS", 10)
    file = tmp_path / "certified.json"
    study.main(["--quick", "--seed", "7", "--json", str(file)])

    def refuse(name):
        raise AssertionError(name)

    rows = json.loads(file.read_text(), parse_constant=refuse)
    assert asked == [("energy_torque", 6, 7), ("Panda", 3, 7)]
    assert {row["table"] for row in rows} == {"energy_torque", "Panda"}
    assert "seconds a point" in {row["row"] for row in rows if row["table"] == "Panda"}
    assert "seconds a point" not in {row["row"] for row in rows if row["table"] == "energy_torque"}
    assert "largest gain" in capsys.readouterr().out


def test_ipopts_program_by_splines_ends_where_ours_does_below_a_peak_too(monkeypatch):
    monkeypatch.setattr(import_module("paretoik.trajectory.levels"), "SAMPLES", replace(SAMPLES, doublings=0))
    limits = pk.Limits(position=tringali_2020.POSITION, velocity=tringali_2020.VELOCITY)
    both = [pk.kinetic_energy, pk.peak_torque]
    problem = pk.Tracking(pk.arms.tringali_3r(), tringali_2020.straight(26), objectives=both, limits=limits)
    front = pk.epsilon_front(problem, points=3, starts=6, seed=0)
    ranges = np.ptp(front.minimised, axis=0)
    peer = spline_program(problem.task)
    for q, values in zip(front.motions.q[:2], front.minimised[:2], strict=True):  # the last one is an end, and flat
        end, _ = peer.solve(q, 0, np.array([np.inf, values[1]]), ranges, warm=True)
        assert end is not None
        rise = (objectives(problem.task, end) - values) / ranges
        assert -2e-4 <= rise[0] <= 2e-6  # ours stay 2.5e-5 of a range within limits, IPOPT's reach them
        assert rise[1] <= 1e-6


def test_pinocchio_recomputes_values_and_sees_those_that_are_wrong(subject):
    task, q, values, ranges = subject.task, subject.q, subject.values, subject.ranges
    assert recomputed_difference(task, q, values, ranges) <= 1e-9
    assert recomputed_difference(task, q, values * 1.001, ranges) > 1e-4


@pytest.mark.parametrize(("name", "redundancy"), [("planar 5R", 2), ("Panda by position", 4)])
def test_cases_have_the_redundancy_that_they_are_there_for(name, redundancy):
    (case,) = (one for one in cases.CASES if one.name == name)
    assert case.make().task.redundancy == redundancy

"""The study of looking ahead, on fewer samples."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import paretoik as pk
from paretoik.resolution.predictive import quartic_spline
from problems import tringali_2021
from studies.tringali_2021.readings import READINGS, Reading, reading_row, slsqp
from studies.tringali_2021.splines import thrice_continuous
from studies.tringali_2021.trajectories import (
    NUMBERS,
    arm_of,
    paper,
    resolve_trajectory,
    schedule_rows,
    spectral_radius,
    table_5,
    text_rows,
)

DERIVATIVES = np.array([[comb(power, order) for power in range(5)] for order in range(5)])


@pytest.fixture(scope="module")
def trajectories():
    return [resolve_trajectory(number, "fitted", starts=4, samples=201) for number in NUMBERS]


def test_the_start_is_where_the_paths_begin():
    for number in NUMBERS:
        problem = tringali_2021.problem(number, samples=21)
        motion = problem.task.motion(np.tile(tringali_2021.START, (21, 1)))
        np.testing.assert_allclose(motion.tool[0], tringali_2021.begin(), atol=1e-12)
    first, last = tringali_2021.trajectory(4).positions[[0, -1]]
    assert np.linalg.norm(last - first) == pytest.approx(0.7)
    assert last[1] < first[1]  # the mirror image


def test_energies_are_compared_with_the_papers(trajectories):
    rows = {(row.row, row.column): row for one in trajectories for row in table_5(one)}
    assert len(rows) == 16
    assert all(row.reference == paper()["Table 5", *place] for place, row in rows.items())
    assert all(0 < rows[f"trajectory {number}", "PMKE time"].ours < 10 for number in NUMBERS)
    for number in (1, 4):
        for method in ("PMKE", "LSV"):
            row = rows[f"trajectory {number}", method]
            assert row.ours == pytest.approx(row.reference, rel=0.04)
    assert rows["trajectory 1", "global"].ours == pytest.approx(rows["trajectory 1", "global"].reference, rel=0.04)
    for number in NUMBERS:
        energies = [rows[f"trajectory {number}", method].ours for method in ("global", "PMKE", "LSV")]
        assert energies == sorted(energies)
    assert "meets a singularity" in rows["trajectory 3", "LSV"].note


def test_the_paper_s_global_optimum_of_trajectory_4_is_one_of_ours_but_not_the_best():
    one = resolve_trajectory(4, "fitted", starts=48, samples=201)
    assert min(abs(energy / paper()["Table 5", "trajectory 4", "global"] - 1) for energy in one.optima) < 0.02
    assert one.optima[0] < 0.8 * paper()["Table 5", "trajectory 4", "global"]
    (note,) = (row.note for row in table_5(one) if row.column == "global")
    assert "is nearest to the paper's" in note


def test_speeds_and_radii_are_compared_with_the_papers(trajectories):
    rows = [row for one in trajectories for row in text_rows(one)]
    assert len(rows) == 19
    speeds = [row for row in rows if row.unit == "rad/s" and row.row != "trajectory 2"]
    assert all(abs(row.ours / row.reference - 1) < 0.12 for row in speeds)
    ahead, local = (trajectories[2].motions[name].manipulability.min() for name in ("PMKE", "LSV"))
    assert ahead > 3 * local  # looking ahead stays farther from the singularity


def test_the_spectral_radius_is_twice_the_most_energy_of_a_unit_velocity():
    arm, rng = arm_of("printed"), np.random.default_rng(0)
    ways = rng.normal(size=(5000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    moving = pk.Motion(
        arm=arm, time=np.arange(3.0), q=1e-6 * np.arange(3.0)[:, None] * ways[:, None], differences="backward"
    )
    largest = 2e12 * moving.kinetic_energy[:, 1].max()
    radius = spectral_radius(pk.Motion(arm=arm, time=np.arange(3.0), q=np.zeros((3, 3))))[0]
    assert 0.99 * radius < largest < radius * (1 + 1e-4)


@pytest.mark.parametrize("generations", [1, pytest.param(5, marks=pytest.mark.slow)])
def test_a_search_finds_a_schedule_no_worse_than_the_papers(generations):
    (row,) = schedule_rows(1, "fitted", starts=4, generations=generations, samples=101)
    assert row.ours < 1.02 * row.reference
    assert "from the global optimum" in row.note


def test_a_reading_that_changes_nothing_is_the_method_itself(trajectories):
    np.testing.assert_array_equal(
        Reading(name="", samples=201).resolve(2, "fitted").q, trajectories[1].motions["PMKE"].q
    )
    other = Reading(name="", samples=201, make_solver=slsqp()).resolve(2, "fitted").q
    np.testing.assert_allclose(other, trajectories[1].motions["PMKE"].q, atol=1e-4)


def test_the_held_posture_gives_the_text_s_numbers_of_trajectory_4():
    (held,) = (reading for reading in READINGS if "posture held" in reading.name)
    row = reading_row(held.name, "fitted", numbers=(4,))
    assert abs(row.ours) < 1.0
    told = row.note.split("what the text says of them: ")[1].removesuffix(" %").split(", ")
    assert len(told) == 3
    assert all(abs(float(each)) < 1.0 for each in told)


@given(pieces=st.integers(2, 6), seed=st.integers(0, 1000), twice=st.sampled_from([0, -1]))
def test_a_thrice_continuous_spline_keeps_points_and_ends_and_its_jerk_at_all_knots_but_one(pieces, seed, twice):
    rng = np.random.default_rng(seed)
    points, rate, second = rng.normal(size=(pieces + 1, 2)), rng.normal(size=2), rng.normal(size=2)
    coefficients = thrice_continuous(points, rate, second, twice=twice)
    if pieces == 2:
        np.testing.assert_allclose(coefficients, quartic_spline(points, rate, second), atol=1e-9)
    begin, end = coefficients, np.einsum("kc,pcd->pkd", DERIVATIVES, coefficients)  # derivatives divided by factorials
    np.testing.assert_allclose(begin[:, 0], points[:-1], atol=1e-9)
    np.testing.assert_allclose(end[:, 0], points[1:], atol=1e-9)
    np.testing.assert_allclose([begin[0, 1], 2 * begin[0, 2]], [rate, second], atol=1e-9)
    np.testing.assert_allclose(end[-1, 1:3], 0.0, atol=1e-7)
    np.testing.assert_allclose(end[:-1, :3], begin[1:, :3], atol=1e-7)
    smooth = np.delete(np.arange(pieces - 1), twice)
    np.testing.assert_allclose(end[smooth, 3], begin[smooth + 1, 3], atol=1e-6)


def test_casadi_finds_the_same_minima_of_the_windows():
    peers = pytest.importorskip("studies.tringali_2021.peers")
    rows = peers.window_rows("fitted", rounds=1, numbers=(1,))
    assert [row.column for row in rows] == ["ours", "SQP with qrqp, CasADi", "FATROP, CasADi"]
    assert all("the same minimum in 17 of 17" in row.note for row in rows)

"""The study of maximum performance and time-optimal motion, on coarse grids."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import paretoik as pk
from paretoik.capability.directional import unit_directions
from paretoik.capability.geodesic import path_time
from paretoik.robot.kinematics import forward_kinematics
from studies.kim_2021.energies import along_profile, postures
from studies.kim_2021.ipopt_programs import looking_ahead, posture_program, root
from studies.kim_2021.maxima import (
    MECHANISMS,
    POSITIONS,
    actuation_of,
    all_surrogates,
    beside_paper,
    grid,
    paper,
    sample_maxima,
    speeds,
    surrogate_rows,
)
from studies.kim_2021.postures import Mechanism, continuous, evenly, minimum_timing
from studies.kim_2021.trajectories import START, TARGET, cheating, fastest_plan, figure_8, possible_time, trajectory


@pytest.fixture(scope="module")
def models():
    return all_surrogates(count=5)


@pytest.fixture(scope="module")
def trajectories(models):
    return {name: trajectory(model, period=0.01, samples=20) for name, model in models.items()}


@pytest.fixture(scope="module")
def ways(trajectories):
    return {name: postures(one, pieces=4, cell=2.0) for name, one in trajectories.items()}


def mechanism(name):
    return Mechanism(arm=pk.arms.kim_3r(), actuation=actuation_of(name))


def test_the_papers_totals_are_its_sums():
    table = {place[1:]: value for place, value in paper().items() if place[0] == "Table 4"}
    for name in MECHANISMS:
        parts = [value for (row, column), value in table.items() if row == name and column != "total"]
        assert sum(parts) == pytest.approx(table[name, "total"], abs=0.15)
    saved = 100 * (table["DAM", "total"] / table["JAM", "total"] - 1)
    assert saved == pytest.approx(table["DAM beside JAM", "total"], abs=0.05)
    assert beside_paper(("Figure 8", "JAM", "arrival"), "s", 1.0).reference == 1.57
    assert beside_paper(("Figure 8", "JAM", "nothing"), "s", 1.0).reference is None


def test_ellipses_are_judged_where_they_were_not_fitted(models):
    for name, surrogates in models.items():
        positions, directions, values = sample_maxima(name, grid(5))
        assert not set(map(tuple, positions)) & set(map(tuple, surrogates.unseen[0]))
        rows = {(row.row, row.column): row.ours for row in surrogate_rows(surrogates)}
        assert rows[f"{name}: ellipsoids", "rms"] >= rows[f"{name}: an ellipse fitted at each position", "rms"] - 0.5
        assert (
            rows[f"{name}: ellipsoids, safe", "largest overestimate"]
            < rows[f"{name}: ellipsoids", "largest overestimate"]
        )
        seen = surrogates.models["ellipsoids, safe"].speeds(positions, directions)
        assert np.all(seen <= values)


def test_arrivals_are_compared_with_the_papers(trajectories):
    rows = {(row.row, row.column): row for row in figure_8(trajectories)}
    for name, one in trajectories.items():
        assert rows[name, "arrival"].reference == paper()["Figure 8", name, "arrival"]
        assert one.run.arrival == pytest.approx(one.geodesic.duration, rel=0.02)
        np.testing.assert_allclose(one.path[[0, -1]], [START, TARGET])
    assert rows["DAM", "sag at x = 150 mm"].note.startswith("LOSS")
    arrivals = {(row.row, row.column): row.ours for row in cheating(trajectories)}
    for name, one in trajectories.items():
        assert (
            arrivals[f"{name}, printed", "claimed"]
            < 0.95 * one.geodesic.duration
            < arrivals[f"{name}, printed", "re-timed"]
        )
        assert arrivals[f"{name}, midpoint", "claimed"] == pytest.approx(
            arrivals[f"{name}, midpoint", "re-timed"], rel=0.01
        )


def test_the_possible_time_of_a_short_piece_is_its_length_over_the_maximum():
    way = np.array([0.6, -0.8])
    path = np.stack([POSITIONS["p5"], POSITIONS["p5"] + 1e-6 * way])
    for name in MECHANISMS:
        fastest = speeds(name, POSITIONS["p5"], way[None])[0]
        assert possible_time(name, path, 2) == pytest.approx(1e-6 / fastest, rel=1e-3)


@pytest.mark.parametrize("name", MECHANISMS)
def test_postures_follow_the_path_and_no_joint_is_hurried(name, ways):
    profile = ways[name].soonest
    arm = pk.arms.kim_3r()
    tool = forward_kinematics(arm, profile.q)[1][..., :2]
    np.testing.assert_allclose(tool, profile.points, atol=1e-12)
    assert np.all(np.diff(profile.times) > 0)
    assert np.abs(profile.turned).max() < np.deg2rad(10)
    assert profile.times[-1] >= ways[name].maxima.lasting.sum() * (1 - 1e-3)


def test_no_other_postures_are_sooner():
    rng, points = np.random.default_rng(0), evenly(np.stack([START, TARGET]), 6)
    best = continuous(mechanism("JAM"), points, cell=0.5)
    for _ in range(200):
        swing = 10 ** rng.uniform(-4, 0.5) * rng.normal(size=4)
        shares = np.linspace(0, 1, len(points))
        angles = best.angles + sum(part * shares**k for k, part in enumerate(swing))
        assert minimum_timing(mechanism("JAM"), points, angles, best.elbows).times[-1] >= best.times[-1] * (1 - 1e-6)


@pytest.mark.parametrize("name", MECHANISMS)
def test_motors_do_the_joints_work(name, ways):
    one = ways[name]
    assert one.driven.energy.sum() == pytest.approx(one.soonest.work.sum(), rel=5e-3)
    if name == "DAM":
        front, back = one.driven.sliders[:, 0], one.driven.sliders[:, 1]
        motors = actuation_of(name)
        rods = front**2 + back**2 + 2 * front * back * np.cos(motors.angles(one.driven.q))
        np.testing.assert_allclose(rods, motors.rod**2 * np.ones_like(rods), rtol=1e-9)
        again = along_profile(mechanism(name), one.soonest)
        np.testing.assert_array_equal(again.speeds, one.driven.speeds)
        assert np.abs(one.driven.speeds).max() <= 7.1e-3 * 1.05  # in the middles of pieces; the limit is at their ends


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_whole_program_finds_nothing_better(name):
    program, place = posture_program(name), POSITIONS["p5"]
    way = unit_directions(16, 2)[3]
    starts = program.starts(place, 4, np.random.default_rng(0))
    assert np.all((starts >= program.lower) & (starts <= program.upper))
    maxima = [program.solved(start, place, way) for start in starts]
    best = max(value for value, success in maxima if success)
    assert best == pytest.approx(speeds(name, place, way[None])[0], rel=1e-6)


def test_a_step_by_ipopt_is_the_same_program(models):
    model = models["DAM"].models["ellipsoids"]
    position = ca.SX.sym("p", 2)
    written = ca.Function("root", [position], [root(model.polynomials, position)])
    np.testing.assert_allclose(written(POSITIONS["p2"]), model.roots(POSITIONS["p2"])[0], rtol=1e-9)
    plan = fastest_plan(model)
    time, success = looking_ahead(model, 10).solved(plan.points, plan.time_to_go)
    assert success
    assert time == pytest.approx(plan.time_to_go, rel=1e-5)
    assert path_time(model, plan.points) == pytest.approx(time, rel=0.01)

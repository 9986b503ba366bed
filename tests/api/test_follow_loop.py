"""Closed loops by the public verbs: followed, kept, chosen from again, ended early."""

from __future__ import annotations

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
import rerun as rr

import paretoik as pk
from paretoik.formulations.protocol import is_loop
from problems import marcos_2012
from tests.closed_loop.postures import posture

STEPS = 12


def short(**settings):
    defaults = {"start": posture(3), "steps": STEPS, "population": 20, "generations": 10}
    return marcos_2012.loop(3, 0.7, **{**defaults, **settings})


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "finished"
    return pk.solve(short(), seed=3, out=out, record_steps=[7, 2]), out


def test_a_loop_becomes_a_front_of_one_motion_of_means_over_steps(finished):
    front, _ = finished
    run = short(seed=3).run()  # neither a folder nor recorded steps change a bit
    assert front.names == ("joint_displacement", "position_error")
    np.testing.assert_array_equal(front.motions.q[0], run.q)
    motion = front.motions[0]
    assert front.objectives[0, 1] == pytest.approx(motion.position_error[1:].mean())
    away = (motion.q[1:] - motion.q[0]) / 1e-3
    squares = (np.diff(motion.q, axis=0) / 1e-3) ** 2
    assert front.objectives[0, 0] == pytest.approx((squares.sum(axis=1) + (away**2).sum(axis=1)).mean())
    assert front.provenance["drift"] == pytest.approx(np.linalg.norm(motion.q[-1] - motion.q[0]) / 3)
    assert front.provenance["counts"]["steps"] == STEPS
    assert is_loop(front)


def test_a_run_folder_has_a_row_and_a_front_of_every_step(finished):
    front, out = finished
    table = pq.read_table(out / "steps.parquet").to_pydict()
    assert table["sample"] == list(range(1, STEPS + 1))
    assert np.mean(table["chosen position_error"]) == pytest.approx(front.objectives[0, 1])
    for name in front.names:
        best, chosen, worst = (np.array(table[f"{what} {name}"]) for what in ("best", "chosen", "worst"))
        assert ((best <= chosen) & (chosen <= worst)).all()
    (store,) = rr.chunk.RrdReader(out / "review.rrd").recordings()
    entities = {str(chunk.entity_path): chunk for chunk in rr.chunk.RrdReader(out / "review.rrd").stream(store=store)}
    assert {"/search/front", "/search/chosen", "/arm/chosen/links"} <= set(entities)
    assert (out / "front.png").stat().st_size > 10_000


def test_searches_of_recorded_steps_are_kept_generation_by_generation(finished):
    front, out = finished
    with np.load(out / "searches.npz") as stored:
        kept = dict(stored)
    assert kept["steps"].tolist() == [2, 7]
    assert kept["names"].tolist() == list(front.names)
    assert kept["objectives"].shape == (2, 11, 20, 2)
    for i, step in enumerate(kept["steps"]):
        for number in range(11):
            F, on_front = kept["objectives"][i, number], kept["on_front"][i, number]
            dominated = [((row >= F).all(axis=1) & (row > F).any(axis=1)).any() for row in F[on_front]]
            assert not any(dominated)
            assert on_front[kept["chosen"][i, number]]
        np.testing.assert_array_equal(kept["q"][i, -1, kept["chosen"][i, -1]], front.motions.q[0, step])
    last = kept["objectives"][0, -1][kept["on_front"][0, -1]]
    assert (last.min(axis=0) <= np.nanmin(kept["objectives"][0, 0], axis=0)).all()


@pytest.mark.parametrize(
    ("steps", "words"),
    [([0], "record_steps"), ([13], "record_steps must be from 1 to 12, got 13"), (["a"], "record_steps")],
)
@pytest.mark.usefixtures("unchecked")
def test_missing_steps_are_refused_before_any_work(steps, words, tmp_path):
    with pytest.raises(pk.InvalidInput, match=words):
        pk.solve(short(), out=tmp_path / "run", record_steps=steps)
    assert not (tmp_path / "run").exists()


def test_other_weights_follow_the_loop_again_from_its_start(finished):
    front, out = finished
    loaded = pk.load_front(out, short())
    for either_front in (front, loaded):
        choice = either_front.select(pk.Weights(position_error=1.0))
        expected = short(seed=3).changed(weights=[0.0, 1.0]).run()
        np.testing.assert_array_equal(choice.motion.q, expected.q)
        assert choice.objectives == pytest.approx(expected.values.mean(axis=0))
        assert "position_error 100%" in choice.reason
    own = front.select(pk.Weights(joint_displacement=2.0, position_error=2.0))
    np.testing.assert_array_equal(own.motion.q, front.motions.q[0])
    assert loaded.problem.reweigh(loaded, pk.Weights(joint_displacement=1.0, position_error=1.0)) is None
    with pytest.raises(pk.InvalidInput, match="must have names among joint_displacement, position_error"):
        front.select(pk.Weights(energy=1.0))


def test_a_time_limit_keeps_the_steps_that_were_taken(tmp_path):
    front = pk.solve(short(), out=tmp_path / "run", time_limit=1e-9)
    assert front.provenance["status"] == "time limit"
    assert front.motions.q.shape[1] == front.provenance["counts"]["steps"] + 1 == 3
    loaded = pk.load_front(tmp_path / "run", short())
    np.testing.assert_array_equal(loaded.motions.q, front.motions.q)


@pytest.mark.parametrize("name", ["evaluations", "target", "anchors", "refine", "solver"])
def test_settings_of_a_search_are_refused_for_a_loop(name):
    with pytest.raises(pk.InvalidInput, match=f"{name} must be used with a search for a front, got a closed loop"):
        pk.solve(short(), **{name: {"target": [1.0, 1.0], "refine": True, "solver": "sqp"}.get(name, 1)})


def test_a_loop_that_is_blocked_says_so_in_its_run(tmp_path):
    wall = pk.obstacles.Circle((0.7 + 0.5 * np.cos(0.06), 0.5 * np.sin(0.06)), 0.005)
    loop = pk.ClosedLoop(
        pk.arms.marcos_nr(3),
        marcos_2012.round_trip(0.7, STEPS),
        start=posture(3),
        obstacles=[wall],
        population=8,
        generations=3,
    )
    with pytest.raises(pk.Infeasible, match=r"step \d+ .*: .* an admissible configuration, got none; the arm is"):
        pk.solve(loop, out=tmp_path / "run")
    assert "obstacle 1 of 1" in json.loads((tmp_path / "run" / "run.json").read_text())["reason"]


@pytest.mark.parametrize("count", [1, 3])
def test_loops_with_one_or_three_objectives_and_a_spatial_arm_are_followed(count):
    arm, q = pk.arms.wan_7r(), np.array([0.2, 0.6, -0.4, -0.8, 0.3, 0.5, 0.1])
    where = pk.Motion(arm=arm, time=np.arange(3.0), q=np.tile(q, (3, 1))).tool[0]
    path = pk.line(where, where + np.array([0.0, 0.002, 0.001]), duration=0.01, samples=4, timing="uniform")
    objectives = [pk.position_error, pk.joint_displacement, pk.manipulability][:count]
    ball = pk.obstacles.Sphere(where + np.array([0.0, 0.3, 0.0]), 0.05)
    loop = pk.ClosedLoop(arm, path, objectives=objectives, start=q, obstacles=[ball], population=20, generations=20)
    front = pk.solve(loop)
    assert front.objectives.shape == (1, count)
    assert front.objectives[0, 0] < 1e-4
    assert front.motions.clearance.min() > 0
    assert front.maximised == (False, False, True)[:count]


def test_position_and_velocity_limits_hold_at_every_step():
    free = pk.solve(short(steps=40))
    q = free.motions.q[0]
    moved = np.argmax(np.ptp(q, axis=0))
    middle = (q[0, moved] + q[-1, moved]) / 2
    limit = np.tile([-np.pi, np.pi], (3, 1))
    limit[moved, int(q[-1, moved] > q[0, moved])] = middle
    fastest = 0.8 * np.abs(np.diff(q, axis=0)).max() / 1e-3
    limits = pk.Limits(position=(limit[:, 0], limit[:, 1]), velocity=1.5 * fastest)
    loop = pk.ClosedLoop(
        pk.arms.marcos_nr(3),
        marcos_2012.round_trip(0.7, 40),
        start=q[0],
        limits=limits,
        population=20,
        generations=20,
    )
    front = pk.solve(loop)
    limited_q = front.motions.q[0]
    assert (limited_q >= limit[:, 0] - 1e-9).all()
    assert (limited_q <= limit[:, 1] + 1e-9).all()
    assert np.abs(np.diff(limited_q, axis=0)).max() <= 1.5e-3 * fastest * (1 + 1e-9)
    assert front.violation[0] < 1e-8


def test_warm_starts_begin_with_the_former_population():
    moved = []
    for seed in range(16):  # with one seed only, the result is random
        cold, warm = short(generations=2, seed=seed), short(generations=2, seed=seed)
        warm.warm_start = True
        first, second = cold.run(), warm.run()
        np.testing.assert_array_equal(first.q[1], second.q[1])
        moved.append((first.F[1:, 1].mean(), second.F[1:, 1].mean()))
    cold_median, warm_median = np.median(moved, axis=0)
    assert warm_median < 0.7 * cold_median

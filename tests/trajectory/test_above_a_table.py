"""Motions above a table, a half-space: planned, step by step, and verified; also between their samples."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import paretoik as pk
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.robot.kinematics import link_nodes
from paretoik.trajectory.infeasibility import no_posture_keeps_limits
from paretoik.verification.arm_model import build_model
from paretoik.verification.measured_motion import measure
from paretoik.verification.motion_checks import check_limits
from problems import marcos_2012
from tests.closed_loop.postures import posture

ARM = pk.arms.tringali_3r()
PATH = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=21)
TABLE = pk.obstacles.HalfSpace([0.3, -0.12], [0.0, 2.0], name="table")
BLOCK = pk.obstacles.Box([0.0, -10.12], [10.0, 10.0])
RADII = [0.0, 0.01, 0.012, 0.015]


def above(*obstacles, clearance=0.005):
    limits = pk.Limits(position=np.deg2rad([90, 120, 120]), clearance=clearance)
    settings = {"objectives": [pk.kinetic_energy], "limits": limits, "link_radius": RADII}
    return pk.Tracking(ARM, PATH, obstacles=obstacles, **settings)


@cache
def planned(*obstacles):
    return pk.plan(above(*obstacles), starts=6).best


def heights(q):
    """Least height of each link (*batch, links) above the table, less its radius, from the joints' positions."""
    y = link_nodes(ARM, q)[..., 1] + 0.12
    return np.minimum(y[..., :-1], y[..., 1:]) - RADII


def test_a_planned_motion_keeps_above_the_table_on_a_grid_50_times_finer():
    motion, fine = planned(TABLE).motion, np.linspace(0.0, 1.0, 20 * 50 + 1)
    assert heights(planned().motion.at(fine)).min() < 0.0  # without the table it goes below
    least = heights(motion.at(fine)).min()
    assert 0.005 - 1e-6 < least < 0.0056
    assert motion.clearance.min() == pytest.approx(heights(motion.q).min(), abs=1e-14)


@pytest.mark.slow
def test_a_table_is_planned_around_as_a_large_box_is():
    assert planned(TABLE).objective == pytest.approx(planned(BLOCK).objective, rel=1e-9)


def test_a_ceiling_across_the_path_is_named_and_the_proof_finds_no_posture():
    high = pk.obstacles.HalfSpace([0.0, 0.1], [0.0, -1.0], name="ceiling")
    with pytest.warns(RuntimeWarning, match="path: the obstacle ceiling, a half-space, is in its way"):
        problem = above(high)
    assert no_posture_keeps_limits(problem.task, 20)
    assert not no_posture_keeps_limits(above(TABLE).task, 20)


@pytest.mark.parametrize("tilt", [0.0, 0.7])
def test_verification_catches_a_motion_below_the_table_and_passes_one_above(tilt):
    motion = planned().motion
    low = float(heights(motion.q).min() - 0.12)
    turned = np.array([np.sin(tilt), np.cos(tilt)])
    reach = float((motion.links[..., :2] @ turned).min()) - max(RADII)
    clear = pk.obstacles.HalfSpace((reach - 1e-3) * turned, turned, name="table")
    planted = pk.obstacles.HalfSpace((reach + 0.03) * turned, turned, name="table")
    assert low < 0.0
    for table, verdict in ((clear, "passed"), (planted, "failed")):
        task = replace(above().task, obstacles=(table,), min_clearance=0.0)
        measured = measure(build_model(ARM), task, motion.time, motion.q)
        (row,) = [row for row in check_limits(task, measured, None, 0) if row.subject == "clearance at samples"]
        assert row.verdict == verdict
        expected = replace(motion, obstacles=(table,), link_radius=RADII).instants.clearance
        np.testing.assert_allclose(measured.clearance[0], expected, atol=1e-9)
        if verdict == "failed":
            assert "the obstacle table, a half-space" in row.detail


def test_a_closed_loop_keeps_clear_of_a_wall_all_the_way():
    arm, start, radii = pk.arms.marcos_nr(3), posture(3), [0.0, 0.01, 0.02, 0.03]
    normal = np.array([np.cos(3.4), np.sin(3.4)])
    wall = pk.obstacles.HalfSpace(-1.6 * normal, normal, name="wall")  # the second joint would go to -1.62
    settings = {"start": start, "population": 40, "generations": 15, "weights": [0.1, 0.9]}
    path, shares = marcos_2012.round_trip(0.7, 25), np.linspace(0.0, 1.0, 51)[:, None, None]

    def least_distance(**more):
        q = ClosedLoop(arm, path, **settings, **more).run().motion.q
        between = (q[:-1] + shares * np.diff(q, axis=0)).reshape(-1, 3)
        depth = link_nodes(arm, between)[..., :2] @ normal + 1.6
        return (np.minimum(depth[:, :-1], depth[:, 1:]) - radii).min()

    assert least_distance() < -0.01
    assert least_distance(obstacles=[wall], link_radius=radii) > 0.0


def test_velocities_with_limits_keep_both_ends_of_a_link_above_the_table():
    limits = pk.Limits(position=12.0, velocity=np.inf, acceleration=np.inf, clearance=0.005)
    start = planned(TABLE).motion.q[0]
    beside = {"start": start, "obstacles": [TABLE], "link_radius": RADII, "unreachable": "track"}
    method = pk.methods.ConstrainedQP()
    free = pk.resolve(ARM, PATH.resample(101), method, start=start, limits=limits, unreachable="track")
    assert heights(free.q).min() < 0.005
    motion = pk.resolve(ARM, PATH.resample(101), method, limits=limits, **beside)
    assert heights(motion.q).min() > 0.005 - 1e-4

"""Tests of the maxima and of the fastest path: by other methods, and by search."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

import paretoik as pk
from paretoik.capability.directional import unit_directions
from paretoik.capability.geodesic import path_time
from paretoik.capability.joint_capability import highest_speeds, joint_speeds
from paretoik.nlp.convex_programs import furthest
from paretoik.robot.dynamics import gravity_torques
from paretoik.robot.kinematics import jacobian
from paretoik.runs.distribution import Executor
from problems.panda import panda
from studies.kim_2021.full_program import full_program, places
from studies.kim_2021.setting import DIRECTIONS, MECHANISMS, POSITIONS, actuation_of, beside_paper, speeds
from studies.kim_2021.trajectories import Trajectory
from studies.processes import run_each
from studies.reporting import Row

TABLE, SAME = "exactness", 1e-6
GOALS = {"closed form beside LP, at most": 1e-12, "v(−d) beside v(d), at most": 1e-12}


def random_postures(
    arm: pk.Arm,
    actuation: pk.capability.JointActuation | pk.capability.DistributedActuation,
    count: int,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return Jacobians at positions (count, task, dof), and joints' lowest and highest speeds, if all can hold."""
    task = 2 if arm.is_planar else 3
    columns, lows, highs = list[np.ndarray](), list[np.ndarray](), list[np.ndarray]()
    while sum(map(len, lows)) < count:
        ends = np.where(np.isfinite(arm.position_limits), arm.position_limits, [-np.pi, np.pi])
        q = ends[:, 0] + np.ptp(ends, axis=1) * rng.uniform(size=(20 * count, arm.dof))
        known = joint_speeds(actuation, q, gravity_torques(arm, q))
        able = np.isfinite(known.low + known.high).all(axis=1)
        columns.append(jacobian(arm, q[able])[:, :task])
        lows.append(known.low[able])
        highs.append(known.high[able])
    first, second, third = (np.concatenate(each)[:count] for each in (columns, lows, highs))
    return first, second, third


def linear_programs(count: int, rng: np.random.Generator) -> list[Row]:
    """Return the largest relative difference of the closed form from linear programs: in the plane and in space."""
    robot = panda()
    arms = [(pk.arms.kim_3r(), actuation_of(each), each) for each in MECHANISMS]
    rows = []
    for arm, actuation, name in [*arms, (robot, pk.capability.JointActuation.of(robot), "Panda, 3-D, its own limits")]:
        columns, low, high = random_postures(arm, actuation, count, rng)
        ways = unit_directions(rng.normal(size=(count, columns.shape[1])), columns.shape[1])
        ours = highest_speeds(columns, low, high, ways[:, None])[:, 0]
        theirs = [furthest(*each)[0] for each in zip(columns, low, high, ways, strict=True)]
        worst = float(np.max(np.abs(ours / np.array(theirs) - 1.0)))
        rows.append(_small(name, "closed form beside LP, at most", worst, f"{count} random postures and directions"))
    return rows


def symmetries(count: int, rng: np.random.Generator) -> list[Row]:
    """Return the difference of opposite maxima, and the deepest dent in the polygon of one posture."""
    rows, ways = [], unit_directions(96, 2)
    for name in MECHANISMS:
        maxima = np.array([speeds(name, position) for position in POSITIONS.values()])
        half = maxima.shape[1] // 2
        worst = float(np.abs(maxima[:, half:] / maxima[:, :half] - 1.0).max())
        rows.append(_small(name, "v(−d) beside v(d), at most", worst, "nine positions, 16 directions"))
        columns, low, high = random_postures(pk.arms.kim_3r(), actuation_of(name), count, rng)
        vertices = highest_speeds(columns, low, high, ways)[..., None] * ways
        edges = np.roll(vertices, -1, axis=1) - vertices
        size = np.linalg.norm(vertices, axis=2).max(axis=1)[:, None] ** 2
        after = np.roll(edges, -1, axis=1)
        bends = (edges[..., 0] * after[..., 1] - edges[..., 1] * after[..., 0]) / size
        rows.append(
            _small(
                name,
                "polygon of one posture: deepest dent",
                max(0.0, -float(bends.min())),
                f"{count} postures, 96 directions; turns of its outline, as shares of its size²; 0 is convex",
            )
        )
    return rows


def many_starts(
    starts: int, rng: np.random.Generator, *, positions: int, executor: Executor | None = None
) -> list[Row]:
    """Return whether IPOPT finds anything better with the whole program from many starts, in 16 directions."""
    calls: dict[tuple[str, str], partial[list[list[tuple[float, bool]]]]] = {}
    for name in MECHANISMS:
        for where in list(places())[:positions]:
            drawn = [full_program(name).starts(places()[where], starts, rng) for _ in range(DIRECTIONS)]
            calls[name, where] = partial(solve_all_ways, name, where, drawn)
    ipopt, rows = run_each(executor, calls), []
    for name in MECHANISMS:
        ratios, failed, missed = list[float](), 0, 0
        for where in list(places())[:positions]:
            for solutions, ours in zip(ipopt[name, where], speeds(name, places()[where]), strict=True):
                ended = [value / ours - 1.0 for value, success in solutions if success]
                failed += len(solutions) - len(ended)
                ratios += ended
                missed += max(ended, default=-1.0) < -SAME
        worst, reached = max(ratios), np.mean(np.array(ratios) > -SAME)
        tried = positions * DIRECTIONS
        note = f"{starts} starts in each of {tried}; {100 * reached:.0f} % of those that end find ours, {failed} fail"
        note += f"; the best of {starts} misses ours in {missed} of {tried}"
        rows.append(beside_paper((TABLE, name, "IPOPT beside ours, at most"), "", worst, _lost(worst, SAME) + note))
    return rows


def solve_all_ways(name: str, where: str, starts: Sequence[np.ndarray]) -> list[list[tuple[float, bool]]]:
    """Return IPOPT's results at a position in every direction, one per start: speeds, and whether it converged."""
    program, ways = full_program(name), unit_directions(DIRECTIONS, 2)
    return [
        [program.solved(start, places()[where], way) for start in each] for way, each in zip(ways, starts, strict=True)
    ]


def random_paths(trajectories: dict[str, Trajectory], count: int, rng: np.random.Generator) -> list[Row]:
    """Return the least delay of random paths from p4 to p6, timed finely: waves about the fastest, and a line."""
    rows = []
    for name, one in trajectories.items():
        model, path = one.surrogates.models["ellipsoids"], one.geodesic.points
        shares = np.linspace(0.0, 1.0, len(path))
        straight = (1 - shares[:, None]) * path[0] + shares[:, None] * path[-1]
        waves = np.sin(np.pi * np.arange(1, 6)[:, None] * shares)
        gained = []
        for k in range(count):
            size = 0.03 * 10 ** rng.uniform(-4, 0) / np.arange(1, 6)[:, None]
            swing = waves.T @ (size * rng.normal(size=(5, 2)))
            around = (straight if k % 2 else path) + swing
            tried = np.clip(around, model.lower, model.upper)
            gained.append(path_time(model, tried, tolerance=1e-9) / one.geodesic.duration - 1.0)
        least = min(gained)
        note = f"{_lost(-least, 1e-7)}{count} paths; nearest {1e6 * least:.2g} millionths slower"
        rows.append(beside_paper((TABLE, name, "random path beside the fastest, least"), "", least, note))
    return rows


def _small(row: str, column: str, value: float, note: str) -> Row:
    goal = GOALS.get(column, 1e-12)
    return beside_paper((TABLE, row, column), "", value, f"{_lost(value, goal)}goal {goal:g}; {note}")


def _lost(value: float, goal: float) -> str:
    return "LOSS: " if value > goal else ""

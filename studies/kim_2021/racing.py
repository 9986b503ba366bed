"""Maxima and steps of control compared with IPOPT: its optima from many starts, and times, alternating in one run."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from time import perf_counter

import numpy as np

import paretoik as pk
from paretoik.capability.directional import unit_directions
from paretoik.capability.speed_models import PolynomialEllipsoids
from paretoik.capability.time_optimal import Planner
from paretoik.runs.distribution import Executor
from studies.kim_2021.ipopt_programs import looking_ahead, posture_program
from studies.kim_2021.maxima import DIRECTIONS, MECHANISMS, POSITIONS, actuation_of, beside_paper, speeds
from studies.kim_2021.trajectories import HORIZON, PERIOD, Trajectory
from studies.processes import run_each
from studies.reporting import Row

EXACT, TIMES = "exactness", "seconds: medians of one run, in turn"
SAME = 1e-6
GOALS = {"JAM": 3.0, "DAM": 15.0}  # ms, for 16 directions
STEP_GOAL = 1.0
TOLERANCE = 1e-8  # IPOPT's own
PLACES = ("p6", "p4", "p5")  # of the trials: that of Figure 5, and the start and middle of Figure 8


def many_starts(
    starts: int, rng: np.random.Generator, *, positions: int, executor: Executor | None = None
) -> list[Row]:
    """Return whether IPOPT finds anything better with the whole program from many starts, in 16 directions."""
    calls: dict[tuple[str, str], partial[list[list[tuple[float, bool]]]]] = {}
    for name in MECHANISMS:
        for where in PLACES[:positions]:
            drawn = [posture_program(name).starts(POSITIONS[where], starts, rng) for _ in range(DIRECTIONS)]
            calls[name, where] = partial(solve_all_ways, name, where, drawn)
    ipopt, rows = run_each(executor, calls), []
    for name in MECHANISMS:
        ratios, failed, missed = list[float](), 0, 0
        for where in PLACES[:positions]:
            for solutions, ours in zip(ipopt[name, where], speeds(name, POSITIONS[where]), strict=True):
                ended = [value / ours - 1.0 for value, success in solutions if success]
                failed += len(solutions) - len(ended)
                ratios += ended
                missed += max(ended, default=-1.0) < -SAME
        worst, reached, tried = max(ratios), np.mean(np.array(ratios) > -SAME), positions * DIRECTIONS
        note = f"{starts} starts in each of {tried}; {100 * reached:.0f} % of those that end find ours, {failed} fail"
        note += f"; the best of {starts} misses ours in {missed} of {tried}"
        prefix = "LOSS: " if worst > SAME else ""
        rows.append(beside_paper((EXACT, name, "IPOPT beside ours, at most"), "", worst, prefix + note))
    return rows


def solve_all_ways(name: str, where: str, starts: Sequence[np.ndarray]) -> list[list[tuple[float, bool]]]:
    """Return IPOPT's results at a position in every direction, one per start: speeds, and whether it converged."""
    program, ways = posture_program(name), unit_directions(DIRECTIONS, 2)
    return [
        [program.solved(start, POSITIONS[where], way) for start in each] for way, each in zip(ways, starts, strict=True)
    ]


def polygon_race(*, rounds: int) -> list[Row]:
    """Return the milliseconds of all 16 directions at p6, ours, and of one start in one direction by IPOPT."""
    arm, position, rng = pk.arms.kim_3r(), POSITIONS["p6"], np.random.default_rng(0)
    ways, programs = (
        unit_directions(DIRECTIONS, 2),
        {name: posture_program(name, ("velocity",), TOLERANCE) for name in MECHANISMS},
    )
    ours, theirs = ({name: list[float]() for name in MECHANISMS} for _ in range(2))
    for name in MECHANISMS:
        speeds(name, position)  # compiled once
    for turn in range(rounds):
        for name in MECHANISMS:
            begun = perf_counter()
            pk.directional_maxima(arm, actuation_of(name), position, DIRECTIONS)
            ours[name].append(perf_counter() - begun)
            start = programs[name].starts(position, 1, rng)[0]
            begun = perf_counter()
            programs[name].solved(start, position, ways[turn % DIRECTIONS])
            theirs[name].append(perf_counter() - begun)
    rows = []
    for name in MECHANISMS:
        mine, other = 1e3 * np.median(ours[name]), 1e3 * np.median(theirs[name])
        place, prefix = f"{name}, 16 directions at p6", "LOSS: " if mine > GOALS[name] else ""
        note = f"{prefix}goal {GOALS[name]:g} ms; all around, every branch; {rounds} rounds"
        rows.append(Row(TIMES, place, "ours", "ms", float(mine), note=note))
        note = f"one start, one direction, a local optimum: 16 of them take {DIRECTIONS * other / mine:.0f} times ours"
        rows.append(Row(TIMES, place, "CasADi + IPOPT", "ms", float(other), note=note))
    return rows


def step_race(one: Trajectory, *, steps: int) -> list[Row]:
    """Return the milliseconds of a step along the trajectory, ours and IPOPT's, both from the step before."""
    model = one.surrogates.models["ellipsoids"]
    assert isinstance(model, PolynomialEllipsoids)
    planner, target = Planner(model, horizon=HORIZON, formulation="midpoint"), one.path[-1]
    ours, theirs, above, failed = list[float](), list[float](), -np.inf, 0
    third = max(1, len(one.path) // 4)
    for begun_at in (0, third, 2 * third):  # three stretches of consecutive steps
        program = looking_ahead(model, HORIZON)
        plan = planner.plan(planner.initial_points(one.path[begun_at], target))
        program.solved(plan.points, plan.time_to_go)
        for position in one.path[begun_at + 1 : begun_at + 1 + steps]:
            begun = perf_counter()
            guess = planner.shift(plan, position, PERIOD)
            after = planner.plan(guess)
            ours.append(perf_counter() - begun)
            begun = perf_counter()
            time_to_go, success = program.solved(guess, plan.time_to_go - PERIOD)
            theirs.append(perf_counter() - begun)
            failed += not success
            above = max(above, after.time_to_go / time_to_go - 1.0) if success else above
            plan = after
    mine, other, whole = (1e3 * float(np.median(each)) for each in (ours, theirs, one.run.seconds))
    place, worst = f"{one.mechanism}, one step of ten pieces", np.quantile(one.run.seconds, 0.99)
    note = f"{'LOSS: ' if mine > STEP_GOAL else ''}goal {STEP_GOAL:g} ms; in the whole trajectory {whole:.3f} ms, 99 % "
    note += (
        f"within {1e3 * worst:.3f} ms, {np.count_nonzero(one.run.seconds > PERIOD)} of {len(one.run.seconds)} over 1 ms"
    )
    beside = (
        f"{'LOSS: ' if other < mine else ''}{other / mine:.1f} times ours; {failed} fail; our times to go are at most"
    )
    return [
        Row(TIMES, place, "ours", "ms", mine, note=note),
        Row(TIMES, place, "CasADi + IPOPT, warm", "ms", other, note=f"{beside} {above:.1e} above its"),
    ]

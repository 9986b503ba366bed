"""Times of maxima and steps, ours and by CasADi with IPOPT and FATROP, alternating in one run."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

import paretoik as pk
from paretoik.capability.directional import unit_directions
from paretoik.capability.speed_models import PolynomialEllipsoids
from paretoik.capability.time_optimal import Planner
from studies.kim_2021.full_program import full_program
from studies.kim_2021.looking_ahead import Peer, looking_ahead
from studies.kim_2021.setting import DIRECTIONS, MECHANISMS, POSITIONS, actuation_of, speeds
from studies.kim_2021.trajectories import HORIZON, PERIOD, Trajectory
from studies.reporting import Row

TABLE = "seconds: medians of one run, in turn"
GOALS = {"JAM": 3.0, "DAM": 15.0}  # ms, for 16 directions
STEP_GOAL = 1.0
PEERS: tuple[Peer, ...] = ("IPOPT, warm", "FATROP")
TOLERANCE = 1e-8  # IPOPT's own


def polygon_race(*, rounds: int) -> list[Row]:
    """Return the milliseconds of all 16 directions at p6, ours, and of one start in one direction by IPOPT."""
    arm, position, rng = pk.arms.kim_3r(), POSITIONS["p6"], np.random.default_rng(0)
    ways = unit_directions(DIRECTIONS, 2)
    ours: dict[str, list[float]] = {name: [] for name in MECHANISMS}
    theirs: dict[str, list[float]] = {name: [] for name in MECHANISMS}
    programs = {name: full_program(name, TOLERANCE) for name in MECHANISMS}
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
        place = f"{name}, 16 directions at p6"
        prefix = "LOSS: " if mine > GOALS[name] else ""
        rows.append(
            _row(place, "ours", mine, f"{prefix}goal {GOALS[name]:g} ms; all around, every branch; {rounds} rounds")
        )
        times = DIRECTIONS * other / mine
        note = (
            f"one start, one direction, a local optimum: 16 directions from one start each take {times:.0f} times ours"
        )
        rows.append(_row(place, "CasADi + IPOPT", other, note))
    return rows


def step_race(one: Trajectory, *, steps: int) -> list[Row]:
    """Return the milliseconds of a step along the trajectory, ours and peers', all from the step before."""
    model = one.surrogates.models["ellipsoids"]
    assert isinstance(model, PolynomialEllipsoids)
    planner, target = Planner(model, horizon=HORIZON, formulation="midpoint"), one.path[-1]
    ours, theirs = list[float](), {peer: PeerSteps() for peer in PEERS}
    third = max(1, len(one.path) // 4)
    for begun_at in (0, third, 2 * third):  # three stretches of consecutive steps
        programs = {peer: looking_ahead(model, HORIZON, peer) for peer in PEERS}
        plan = planner.plan(planner.initial_points(one.path[begun_at], target))
        for program in programs.values():
            program.solved(plan.points, plan.time_to_go)
        for position in one.path[begun_at + 1 : begun_at + 1 + steps]:
            begun = perf_counter()
            guess = planner.shift(plan, position, PERIOD)
            after = planner.plan(guess)
            ours.append(perf_counter() - begun)
            for peer, program in programs.items():
                begun = perf_counter()
                time_to_go, success = program.solved(guess, plan.time_to_go - PERIOD)
                theirs[peer].add(perf_counter() - begun, after.time_to_go / time_to_go - 1.0 if success else None)
            plan = after
    mine, whole = (1e3 * float(np.median(each)) for each in (ours, one.run.seconds))
    place = f"{one.mechanism}, one step of ten pieces"
    prefix, worst = "LOSS: " if mine > STEP_GOAL else "", np.quantile(one.run.seconds, 0.99)
    note = f"{prefix}goal {STEP_GOAL:g} ms; in the whole trajectory {whole:.3f} ms, 99 % within {1e3 * worst:.3f} ms"
    over = f", {np.count_nonzero(one.run.seconds > PERIOD)} of {len(one.run.seconds)} over 1 ms"
    rows = [_row(place, "ours", mine, note + over)]
    return rows + [_row(place, f"CasADi + {peer}", *each.summary(mine)) for peer, each in theirs.items()]


@dataclass(kw_only=True)
class PeerSteps:
    """A peer's times of steps [s], the most by which our times to go exceed its, and its number of failures."""

    seconds: list[float] = field(default_factory=list)
    above: float = -np.inf
    failed: int = 0

    def add(self, seconds: float, above: float | None) -> None:
        """Count a step; None ``above`` is a failure."""
        self.seconds.append(seconds)
        self.failed += above is None
        self.above = self.above if above is None else max(self.above, above)

    def summary(self, ours: float) -> tuple[float, str]:
        """Return the median milliseconds, and a note."""
        median = 1e3 * float(np.median(self.seconds))
        prefix = "LOSS: " if median < ours else ""
        note = f"{prefix}{median / ours:.1f} times ours; {self.failed} fail; our times to go are at most"
        return median, f"{note} {self.above:.1e} above its"


def _row(row: str, column: str, ours: float, note: str) -> Row:
    return Row(table=TABLE, row=row, column=column, unit="ms", ours=float(ours), note=note)

"""The problems whose fronts are navigated, their goals, and the peers that can state them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

import paretoik as pk
from problems import kim_2021, panda, tringali_2020
from studies.benchmarks.peers.programs import joint_program, staged_program
from studies.benchmarks.peers.solvers import Peer, compiled
from studies.benchmarks.planner.questions import tracking

POST, RADIUS, THICKNESS, CLEARANCE = (0.33, -0.1), 0.04, 0.015, 0.005  # m: of post and links


@dataclass(frozen=True, kw_only=True)
class Goals:
    """The goals of a problem's moves: a step [ms], certified ones and best known ones [%]."""

    step: float | None = None
    certified: float | None = None
    best: float | None = None


@dataclass(frozen=True, kw_only=True)
class Case:
    """A problem, the size of its front, whether peers have a program of it, and whether that is compiled."""

    make: Callable[[], pk.Tracking | pk.DirectionalMaxima | pk.PointToPoint]
    points: int = 12
    has_peers: bool = True
    compiles: bool = True
    goals: Goals = Goals()


def past_a_post() -> pk.Tracking:
    """Return the papers' line with a post next to it that the links must stay clear of."""
    return pk.Tracking(
        pk.arms.tringali_3r(),
        tringali_2020.straight(51),
        objectives=[pk.kinetic_energy, pk.torque_norm],
        limits=pk.Limits(position=np.deg2rad([90, 120, 120]), clearance=CLEARANCE),
        obstacles=[pk.obstacles.Circle(POST, RADIUS)],
        link_radius=THICKNESS,
        differences="backward",
    )


CASES = {
    "papers' arm, energy against torque": Case(
        make=tringali_2020.energy_torque, points=20, goals=Goals(step=10.0, certified=99.5, best=98.0)
    ),
    "papers' arm, circle": Case(make=partial(tracking, "simulation_5", both=True)),
    "papers' arm, past a post": Case(make=past_a_post, has_peers=False),
    "Panda, three objectives": Case(
        make=panda.across_the_table, compiles=False, goals=Goals(step=100.0, certified=95.0, best=93.0)
    ),
    "directions, motors at the joints": Case(make=kim_2021.directions_jam, has_peers=False),
    "point to point, sliders": Case(make=kim_2021.point_to_point_dam, has_peers=False),
}
QUICK = tuple(CASES)[:1]


def peers_of(case: Case, problem: object, folder: Path) -> dict[str, Peer]:
    """Return the peers that can state a problem, compiled into a folder."""
    if not case.has_peers or not isinstance(problem, pk.Tracking):
        return {}
    task, into = problem.task, folder if case.compiles else None
    peers = {"IPOPT": compiled(joint_program(task), f"navigated{'_cycle' * task.cyclic}", into)}
    if not task.cyclic:
        peers["FATROP"] = compiled(staged_program(task), "navigated_staged", into)
    return peers

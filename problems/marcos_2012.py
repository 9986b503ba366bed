"""Marcos, Machado & Azevedo-Perdicoúlis 2012: two turns of a circle, with a search at every millisecond.

Arms of three or four unit links, the circle's centre 0.7 or 2 m from the base, with or without the two obstacles of
section 5.2. A closed loop is run step by step::

    run = circle_3r().run()
    run.position_error, run.drift

Each of its steps is a search of its own, which any pymoo algorithm solves: ``circle_3r().control_step(1)``.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from paretoik import ClosedLoop, ControlStep, Path, Posture, arms, circle, obstacles
from paretoik.collision.obstacles import Obstacle

RATE = 7.0  # rad/s
RADIUS = 0.5
STEP = 1e-3  # s
TURNS = 2
LONGEST = 0.1  # rad, largest joint step
STEPS = int(TURNS * 2 * np.pi / RATE / STEP)
DISTANCES = (0.7, 2.0)
POPULATION = {3: 200, 4: 400}
Links = Literal[3, 4]


def round_trip(distance: float, steps: int = STEPS) -> Path:
    """Return the circle up to the last whole step: two turns take 0.2 ms longer."""
    angle = RATE * STEP * steps
    return circle(
        (distance, 0.0), RADIUS, duration=STEP * steps, samples=steps + 1, turns=angle / (2 * np.pi), timing="uniform"
    )


def paper_obstacles(distance: float) -> list[Obstacle]:
    """Return the circle and the rectangle of section 5.2."""
    if distance == DISTANCES[0]:
        return [obstacles.Circle((1.4, 0.5), 0.2), _rectangle((0.3, 1.7), (0.8, 1.3))]
    return [obstacles.Circle((1.6, 0.6), 0.2), _rectangle((0.4, 1.0), (0.9, 0.6))]


def loop(
    links: Links,
    distance: float,
    *,
    weight: float = 0.5,
    blocked: bool = False,
    steps: int = STEPS,
    start: np.ndarray | None = None,
    population: int | None = None,
    generations: int = 200,
    seed: int = 0,
    as_printed: bool = False,
    warm_start: bool = False,
) -> ClosedLoop:
    """Return the closed loop of the paper; ``weight``: weight of the displacement.

    ``as_printed`` leaves joint steps unbounded, as the paper does: the arm can jump through an obstacle.
    """
    return ClosedLoop(
        arms.marcos_nr(links),
        round_trip(distance, steps),
        weights=[weight, 1.0 - weight],
        start=start,
        obstacles=paper_obstacles(distance) if blocked else [],
        longest_step=np.inf if as_printed else LONGEST,
        population=POPULATION[links] if population is None else population,
        generations=generations,
        seed=seed,
        warm_start=warm_start,
    )


def circle_3r() -> ClosedLoop:
    """Two turns of a circle with three links, displacement and error weighted equally."""
    return loop(3, 0.7)


def circle_4r() -> ClosedLoop:
    """Two turns of a circle with four links, displacement and error weighted equally."""
    return loop(4, 0.7)


def circle_3r_obstacles() -> ClosedLoop:
    """Two turns of a circle with three links, clear of two obstacles."""
    return loop(3, 0.7, blocked=True)


def circle_4r_obstacles() -> ClosedLoop:
    """Two turns of a circle with four links, clear of two obstacles."""
    return loop(4, 0.7, blocked=True)


def first_step(links: Links = 4, distance: float = 0.7, *, blocked: bool = True) -> ControlStep:
    """Return the search of a loop's first step, from a posture that OLGA finds (sections 4.1 and 4.2)."""
    return loop(links, distance, blocked=blocked).control_step(1)


def first_posture(links: Links = 4, distance: float = 0.7, *, blocked: bool = True) -> Posture:
    """Return the search for a loop's first posture, clear of the obstacles there (section 4.2)."""
    return Posture(
        arms.marcos_nr(links), round_trip(distance, 3), obstacles=paper_obstacles(distance) if blocked else []
    )


def _rectangle(upper_left: tuple[float, float], lower_right: tuple[float, float]) -> obstacles.Box:
    first, last = np.array(upper_left), np.array(lower_right)
    return obstacles.Box((first + last) / 2, np.abs(last - first) / 2)

"""What the engine works on and in, by name: tuples of arrays and numbers, as compiled code takes them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

BOUND = 1.0  # of every gene, either side
TRIES = 100  # at a chromosome whose configuration is free
SLACK = 1e-10  # rad or m: a step that was shortened may round to a little more
FINEST = 2.0**-8  # of a step: parts that are not seen to be clear are halved down to this
LOOKED = 64  # places on the way of steps that are looked at together


class Operators(NamedTuple):
    """Chances of crossover and mutation, and the bounds of every gene."""

    crossing: float
    mutating: float
    low: float
    high: float


class Place(NamedTuple):
    """Where a step begins: joint positions (dof,), the shortest step that makes Δx, and the null space of the Jacobian.

    ``rates`` (3, dof) are velocity, acceleration and jerk before, ``dt`` [s] the time between steps.
    """

    previous: np.ndarray
    particular: np.ndarray
    null: np.ndarray
    rates: np.ndarray
    dt: float


class Worth(NamedTuple):
    """The program of the objectives, and how many orders of rates it reads: 1 for positions alone."""

    program: Any
    orders: int


class Guard(NamedTuple):
    """The obstacles, what is required of the distance of the arm's polyline from them [m], and how far a step may go.

    ``nodes`` is the program of the polyline, ``obstacles`` what ``scene`` returns, ``enclosing`` what ``round_scene``
    does. ``reach`` (dof,) is the most that
    any point of the arm moves with each joint, ``lower`` and ``upper`` (dof,) bound how far each may move, where
    ``bounded``; ``swept`` says that all of a step is to be clear, not its end alone. Its end keeps a ``standoff`` [m]
    beyond what is required.
    """

    nodes: Any
    obstacles: np.ndarray
    enclosing: np.ndarray
    required: float
    reach: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    bounded: bool
    swept: bool
    standoff: float


class Selection(NamedTuple):
    """Room for the choice among N parents and N children."""

    points: np.ndarray
    front: np.ndarray
    value: np.ndarray
    x: np.ndarray
    y: np.ndarray
    waiting: np.ndarray
    spare: np.ndarray
    rank: np.ndarray
    scaled: np.ndarray
    nearest: np.ndarray
    taken: np.ndarray
    keys: np.ndarray
    begins: np.ndarray
    along: np.ndarray
    distance: np.ndarray


class Room(NamedTuple):
    """A population and its children, and room for what is computed of them; one a thread.

    ``genes`` has a row an individual, ``order`` says which row stands at which place, ``worth`` is that in a
    tournament, by place. ``F`` has the objectives of the parents by place, then those of the children, whose genes are
    the columns of ``children``.
    """

    genes: np.ndarray
    F: np.ndarray
    order: np.ndarray
    worth: np.ndarray
    children: np.ndarray
    state: np.ndarray
    given: np.ndarray
    table: np.ndarray
    nodes: np.ndarray
    gaps: np.ndarray
    work: np.ndarray
    asked: np.ndarray
    places: np.ndarray
    spans: np.ndarray
    parts: np.ndarray
    selection: Selection
    values: np.ndarray


def room(dof: int, redundancy: int, population: int, objectives: int, inputs: int) -> Room:
    """Return room for a population, and programs of so many inputs."""
    N, M, r, size, both = population, objectives, redundancy, redundancy * (dof + 1), 2 * population
    looked = max(N, LOOKED)
    index = np.int64
    selection = Selection(
        points=np.zeros(both, index),
        front=np.zeros(both, index),
        value=np.zeros(both),
        x=np.zeros(both),
        y=np.zeros(both),
        waiting=np.zeros((both, 2), index),
        spare=np.zeros(both, index),
        rank=np.zeros(both, index),
        scaled=np.zeros((M, both)),
        nearest=np.zeros(both),
        taken=np.zeros(both, index),
        keys=np.zeros((4, both)),
        begins=np.zeros(both + 2, index),
        along=np.zeros((M, both)),
        distance=np.zeros(both),
    )
    return Room(
        genes=np.zeros((N, size)),
        F=np.zeros((M, both)),
        order=np.zeros(N, index),
        worth=np.zeros(N),
        children=np.zeros((size, N)),
        state=np.zeros(1, np.uint64),
        given=np.zeros((inputs, N)),
        table=np.zeros((dof, looked)),
        nodes=np.zeros((3 * (dof + 2), looked)),
        gaps=np.zeros(looked),
        work=np.zeros((r * r + r, N)),
        asked=np.zeros(N, index),
        places=np.zeros(N, index),
        spans=np.zeros(N),
        parts=np.zeros((5, N + LOOKED * 16)),
        selection=selection,
        values=np.zeros((M, N)),
    )

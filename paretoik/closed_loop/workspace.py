"""Inputs and outputs of the engine: tuples of arrays and numbers, as compiled code takes them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np


class EngineOptions(NamedTuple):
    """Settings of a step's search and of the test whether a step is admissible."""

    crossover_probability: float = 0.5  # p_c of Marcos et al. 2012, section 5.1
    mutation_probability: float = 0.5  # p_m, ibid.
    gene_bound: float = 1.0  # genes lie within ±1, ibid.
    max_redraws: int = 100  # of inadmissible chromosomes (section 5.2 redraws until they are admissible)
    bound_tolerance: float = 1e-10  # rad or m: rounding error of a shortened step at its bounds
    shortest_interval: float = 2.0**-8  # share of a step: intervals not proven clear are halved down to this
    interval_batch: int = 64  # number of intervals whose middles are evaluated together
    interval_depth: int = 16  # number of batches that fit on the stack of intervals
    singular_ratio: float = 1e-9  # ratio of a Jacobian's singular values below which no finite step makes every Δx


OPTIONS = EngineOptions()


class StepStart(NamedTuple):
    """Start of a step: joint positions (dof,), the shortest step that makes Δx, and the null space of the Jacobian.

    ``rates`` (3, dof) are velocity, acceleration and jerk before the step, ``dt`` [s] is the time between steps.
    """

    previous: np.ndarray
    particular: np.ndarray
    null_space: np.ndarray
    rates: np.ndarray
    dt: float


class ObjectiveProgram(NamedTuple):
    """The evaluator of the objectives, and the number of orders of rates that it reads: 1 for positions only."""

    arrays: Any
    orders: int


class StepConstraints(NamedTuple):
    """The obstacles, the required distance of the arm's links from them [m], and the bounds of joints' moves.

    - ``nodes``: evaluator of the positions of the arm's joints
    - ``obstacles``, ``bounding``: rows of ``tabulate`` for obstacles, and for the balls around them
    - ``reach`` (dof,): largest move of any point of the arm with each joint
    - ``lower``, ``upper`` (dof,): bounds of each joint's move, if ``bounded``
    - ``swept``: whether the whole step must be clear, not only its end
    - ``standoff``: distance at its end beyond the required one [m]
    """

    nodes: Any
    obstacles: np.ndarray
    bounding: np.ndarray
    required: float
    reach: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    bounded: bool
    swept: bool
    standoff: float


class KeptGenerations(NamedTuple):
    """Generations of a search: genes (generations, individuals, genes), objectives (generations, individuals, n_obj).

    The first generation is the one that a search begins with. Objectives are minimised, inf if a step failed.
    """

    genes: np.ndarray
    F: np.ndarray


class SelectionWorkspace(NamedTuple):
    """Arrays for the choice among N parents and N children."""

    points: np.ndarray
    front: np.ndarray
    fitness: np.ndarray
    x: np.ndarray
    y: np.ndarray
    stack: np.ndarray
    places: np.ndarray
    dominated: np.ndarray
    spare: np.ndarray
    rank: np.ndarray
    scaled: np.ndarray
    nearest: np.ndarray
    chosen: np.ndarray
    values: np.ndarray
    begins: np.ndarray
    objectives: np.ndarray
    distance: np.ndarray


class Workspace(NamedTuple):
    """A population and its children, and arrays for their evaluation; each thread needs its own.

    - ``genes``: one row per individual
    - ``order``: row of each place
    - ``fitness``: fitness in a tournament, by place
    - ``F``: objectives of the parents by place, then those of the children
    - ``children``: genes of the children, in columns
    - ``inputs``: joint positions and rates of the children, in columns
    - ``redrawn``, ``redrawn_positions``: genes and joint positions drawn in place of inadmissible children
    """

    genes: np.ndarray
    F: np.ndarray
    order: np.ndarray
    fitness: np.ndarray
    children: np.ndarray
    redrawn: np.ndarray
    redrawn_positions: np.ndarray
    state: np.ndarray
    inputs: np.ndarray
    outputs: np.ndarray
    linear_systems: np.ndarray
    pending: np.ndarray
    candidates: np.ndarray
    travel: np.ndarray
    scale: np.ndarray
    configurations: np.ndarray
    nodes: np.ndarray
    distances: np.ndarray
    intervals: np.ndarray
    selection: SelectionWorkspace


def allocate(
    dof: int, redundancy: int, population: int, objectives: int, inputs: int, options: EngineOptions = OPTIONS
) -> Workspace:
    """Return the workspace of a population, and of evaluators with this number of inputs."""
    N, M, r, size, both = population, objectives, redundancy, redundancy * (dof + 1), 2 * population
    evaluated, index = max(N, options.interval_batch), np.int64
    selection = SelectionWorkspace(
        points=np.zeros(both, index),
        front=np.zeros(both, index),
        fitness=np.zeros(both),
        x=np.zeros(both),
        y=np.zeros(both),
        stack=np.zeros((both, 2), index),
        places=np.zeros(N, np.uint64),
        dominated=np.zeros(N, np.uint64),
        spare=np.zeros(both, index),
        rank=np.zeros(both, index),
        scaled=np.zeros((M, both)),
        nearest=np.zeros(both),
        chosen=np.zeros(both, index),
        values=np.zeros((4, both)),
        begins=np.zeros(both + 2, index),
        objectives=np.zeros((M, both)),
        distance=np.zeros(both),
    )
    return Workspace(
        genes=np.zeros((N, size)),
        F=np.zeros((M, both)),
        order=np.zeros(N, index),
        fitness=np.zeros(N),
        children=np.zeros((size, N)),
        redrawn=np.zeros((size, N)),
        redrawn_positions=np.zeros((dof, N)),
        state=np.zeros(1, np.uint64),
        inputs=np.zeros((inputs, N)),
        outputs=np.zeros((M, N)),
        linear_systems=np.zeros((r * r + r, N)),
        pending=np.zeros(N, index),
        candidates=np.zeros(N, index),
        travel=np.zeros(N),
        scale=np.zeros(N),
        configurations=np.zeros((dof, evaluated)),
        nodes=np.zeros((3 * (dof + 2), evaluated)),
        distances=np.zeros(evaluated),
        intervals=np.zeros((5, N + options.interval_batch * options.interval_depth)),
        selection=selection,
    )

"""What the engine reads and writes, by name: tuples of arrays and numbers, as compiled code takes them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np


class EngineOptions(NamedTuple):
    """Settings of a step's search and of the test whether a step is admissible."""

    crossover_probability: float = 0.5  # p_c of Marcos et al. 2012, section 5.1
    mutation_probability: float = 0.5  # p_m, ibid.
    gene_bound: float = 1.0  # genes lie within ±1, ibid.
    max_redraws: int = 100  # of chromosomes whose configuration is not admissible (section 5.2 says: until it is)
    bound_tolerance: float = 1e-10  # rad or m: rounding may put a shortened step this far beyond its bounds
    shortest_interval: float = 2.0**-8  # of a step: intervals that are not proven clear are halved down to this
    interval_batch: int = 64  # intervals of steps whose middles are evaluated together
    interval_depth: int = 16  # batches that fit on the stack of intervals
    singular_ratio: float = 1e-9  # of the singular values of a Jacobian: below, no finite step makes every Δx


OPTIONS = EngineOptions()


class StepStart(NamedTuple):
    """Where a step begins: joint positions (dof,), the shortest step that makes Δx, and the null space of the Jacobian.

    ``rates`` (3, dof) are velocity, acceleration and jerk before the step, ``dt`` [s] the time between steps.
    """

    previous: np.ndarray
    particular: np.ndarray
    null_space: np.ndarray
    rates: np.ndarray
    dt: float


class ObjectiveProgram(NamedTuple):
    """The evaluator of the objectives, and how many orders of rates it reads: 1 for positions alone."""

    arrays: Any
    orders: int


class StepConstraints(NamedTuple):
    """The obstacles, the required distance of the arm's links from them [m], and how far each joint may move.

    ``nodes`` is the evaluator of the places of the arm's joints; ``obstacles`` and ``bounding``, the balls around them,
    are rows of ``tabulate``. ``reach`` (dof,) is the most that any point of the arm moves with each joint, ``lower``
    and ``upper`` (dof,) bound how far each joint may move, where ``bounded``; ``swept`` says that the whole step is to
    be clear, not its end alone. Its end keeps a ``standoff`` [m] beyond what is required.
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

    The first generation is the one that a search begins with. Objectives are minimised, inf where a step failed.
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
    """A population and its children, and arrays for what is computed of them; one a thread.

    ``genes`` has a row an individual, ``order`` says which row stands at which place, ``fitness`` is that in a
    tournament, by place. ``F`` has the objectives of the parents by place, then those of the children, whose genes are
    the columns of ``children`` and whose joint positions and rates are the columns of ``inputs``. ``redrawn`` has the
    genes drawn in place of inadmissible children's, ``redrawn_positions`` their joint positions.
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
    """Return the workspace of a population, and of evaluators with so many inputs."""
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

"""The grid oracle: the best motions over a grid of postures.

It uses dynamic programming, for one degree of redundancy.

The postures that reach a sample are on a few curves. These are traced and cut into evenly spaced nodes; two nodes of
consecutive samples are joined if no joint moves too far.
- If objectives and limits depend only on positions and velocities (backward differences), the best path is exact on
  this grid, and ``lower_bound`` bounds all motions between its nodes.
- If they depend on accelerations, states are pairs of consecutive nodes, on fewer samples. The result, resampled to all
  samples, is a source of starts and gives no bound.

Source: Bellman 1957 (dynamic programming); Burdick 1989 (self-motion curves).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.errors import Infeasible, InvalidInput
from paretoik.task.limits import LIMIT_TOLERANCE
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.self_motion import branch_labels, count_nodes, node_spacing, postures_along_path, trace_curves
from paretoik.trajectory.levels import coarsest_level
from paretoik.trajectory.posture_grid import (
    OPTIONS,
    PostureGrid,
    Terms,
    build_graph,
    build_terms,
    evaluate_at,
    posture_grid,
    step_windows,
    transitions,
)
from paretoik.trajectory.shortest_paths import LayeredGraph, distinct_paths, shortest_path

# A lower bound on all motions, for redundancy one and without accelerations
#
# At every sample a motion is in a cell: between two neighbouring nodes. Round every sample independently to one of
# these two, with probabilities that make the mean the motion's own place. The mean cost of the rounded paths is the sum
# of each transition's cost, interpolated between the corners of its cell; it exceeds the motion's cost by at most
# the interpolation error. Some rounded path costs at most the mean. So the best path through the grid, with that error
# subtracted from every transition and limits relaxed by their change within a cell, is a lower bound.
#
# The error is estimated from second differences D between neighbouring transitions of all cells around. If costs are
# smooth, it is ⅛ max D; if they have a kink and are convex along the curves, ½ max D. At a kink D jumps from node to
# node, so that ⅛ max D + ⅜ (max D − min D) is valid for both. The change of limits within a cell is estimated from
# first differences.


def lower_bound(task: MotionTask, grid: PostureGrid, terms: Terms, spacing: float) -> float:
    """Return a lower bound on every motion within the grid's windows.

    It is infinite if limits allow no motion. ``grid`` has all nodes, also infeasible ones, and some beyond the joints'
    ranges.
    """
    wide = replace(grid, windows=grid.windows + OPTIONS.margin * spacing * grid.scales)
    pairs, edge = transitions(task, wide)
    counts = [len(sources) for sources, _ in pairs]
    costs = evaluate_at(task, terms.sample_costs, counts, edge)
    rates = evaluate_at(task, terms.rates, counts, edge)
    postures = evaluate_at(task, terms.postures, [len(q) for q in grid.nodes], grid.at_rest)
    nodes = [_may_satisfy(excess, [_neighbours(ahead)]) for excess, ahead in zip(postures, grid.next_node, strict=True)]
    masks = []
    for i, (sources, ends) in enumerate(pairs[1:], 1):
        around = _neighbouring_transitions(sources, ends, grid.next_node[i - 1], grid.next_node[i])
        costs[i] -= sum(_interpolation_error(costs[i], pair, around) for pair in around)
        steps = np.abs(grid.step(grid.nodes[i][ends], grid.nodes[i - 1][sources]))
        near = steps <= grid.windows[i] + OPTIONS.cell * spacing * grid.scales
        masks.append(near.all(axis=1) & nodes[i - 1][sources] & nodes[i][ends] & _may_satisfy(rates[i], around))
    layers = build_graph(grid, pairs, costs).prune(masks, np.where(nodes[0], 0.0, np.inf))
    return shortest_path(layers, task.cyclic)[0]


Pair = tuple[np.ndarray, np.ndarray]  # indices of the neighbours on both sides, −1 without a neighbour


def _neighbours(ahead: np.ndarray) -> Pair:
    """Return the node after and the node before each on its curve."""
    behind = np.full(len(ahead), -1)
    inner = np.flatnonzero(ahead >= 0)
    behind[ahead[inner]] = inner
    return ahead, behind


def _neighbouring_transitions(
    sources: np.ndarray, ends: np.ndarray, before: np.ndarray, here: np.ndarray
) -> list[Pair]:
    """Return the transitions next to each.

    The first pair has the next and the last source, the second pair the next and the last end.
    """
    width = len(before)
    keys = ends * width + sources  # ascending

    def at(source: np.ndarray, end: np.ndarray) -> np.ndarray:
        key = end * width + source
        place = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
        return np.where((source >= 0) & (end >= 0) & (keys[place] == key), place, -1)

    (later, earlier), (up, down) = (_neighbours(ahead) for ahead in (before, here))
    return [
        (at(later[sources], ends), at(earlier[sources], ends)),
        (at(sources, up[ends]), at(sources, down[ends])),
    ]


def _interpolation_error(values: np.ndarray, pair: Pair, around: list[Pair]) -> np.ndarray:
    """Return the largest interpolation error in cells around.

    It is estimated from second differences.
    """
    after, before = pair
    second_differences = values[after] + values[before] - 2 * values
    convex = np.maximum(np.where((after >= 0) & (before >= 0), second_differences, np.nan), 0.0)  # NaN stays NaN
    largest, smallest = _neighbourhood_max(convex, around), -_neighbourhood_max(-convex, around)
    return np.where(largest >= smallest, largest / 8 + 3 / 8 * (largest - smallest), 0.0)


def _neighbourhood_max(values: np.ndarray, around: list[Pair]) -> np.ndarray:
    """Return the largest known value among values and their neighbours.

    It is NaN if all are unknown.
    """
    for pair in around:
        values = np.fmax.reduce([values, *(np.where(side >= 0, values[side], np.nan) for side in pair)])
    return values


def _may_satisfy(excess: np.ndarray, around: list[Pair]) -> np.ndarray:
    """Return which transitions may satisfy limits within an adjacent cell."""
    margin: np.ndarray | float = 0.0
    for pair in around:  # first differences between neighbours
        differences = [np.where(side >= 0, np.abs(excess[side] - excess), 0.0) for side in pair]
        margin = margin + _neighbourhood_max(np.max(differences, axis=0), around)
    return np.asarray(excess <= LIMIT_TOLERANCE + margin)


# The grid oracle: all motions over a grid.


@dataclass(frozen=True, kw_only=True, eq=False)
class GridOracle:
    """Motions found on the grid, best first.

    They are the best of each class, and motions far from these.

    q: joint positions of the motions
    labels: branch labels of the motions
    values: sums of objectives (minimised)
    violations: worst violation of limits
    resolution: distance of neighbouring nodes [rad, the arm's length]
    samples: number of samples on the grid
    exact: whether no path through the grid is better than the first motion
    lower_bound: bound on all motions on the traced curves within the same pace; NaN if not ``exact``, or if ``quick``

    The bound's error decreases with the square of the resolution; if limits are active, in proportion to the
    resolution.
    """

    q: Float[np.ndarray, "paths time dof"]
    values: Float[np.ndarray, " paths"]
    violations: Float[np.ndarray, " paths"]
    labels: tuple[str, ...]
    resolution: float
    samples: int
    exact: bool
    lower_bound: float

    @property
    def best(self) -> float:
        """The objective value of the best path through the grid."""
        return float(self.values[0])


def grid_oracle(
    task: MotionTask,
    *,
    resolution: float | None = None,
    classes: int = 8,
    seed: int = 0,
    quick: bool = False,
) -> GridOracle:
    """Return the best paths through a grid of postures, one per class.

    The task must have one degree of redundancy.

    task: motion task with integral objectives, whose sum is minimised, and backward differences
    resolution: distance [rad, the arm's length] between nodes; None for a share of the largest step of a joint between
        samples, or more if there were too many nodes
    classes: largest number of motions; the first ones are one per class (bends of joints and their turns)
    seed: seed of the first postures; it has little effect on the curves through them
    quick: whether to leave out the bound, and to refuse slow problems

    Joints without velocity limit may move at a few times the pace that the path needs. Raises InvalidInput if the
    redundancy is not one, or for other unsupported parts, with ``quick`` also for accelerations and very many postures;
    OutOfReach if the path is out of reach; Infeasible if no path through the grid exists.
    """
    if task.redundancy != 1:
        raise InvalidInput(f"grid_oracle: redundancy must be 1, got {task.redundancy}")
    if task.differences != "backward" or task.ends_at_rest:
        wrong = "end_velocity=0" if task.ends_at_rest else f"{task.differences} differences"
        raise InvalidInput(f"grid_oracle: differences must be backward and the end free, got {wrong}")
    if resolution is not None and not resolution > 0:
        raise InvalidInput(f"resolution must be a positive distance in rad, got {resolution}")
    # nodes on the curves of postures, and windows of steps
    seeds, pace = postures_along_path(task, np.random.default_rng(seed))
    terms = build_terms(task, np.stack([q[0] for q in seeds])[None])
    if quick and terms.second:
        raise InvalidInput("grid_oracle: quick=True must have no objectives or limits of accelerations, got some")
    level = coarsest_level(task) if terms.second else task
    sample_index = np.searchsorted(task.times, level.times)
    windows = step_windows(level, OPTIONS.pace * pace * (len(task.times) - 1) / (len(level.times) - 1))
    curves = trace_curves(level, [seeds[i] for i in sample_index])
    spacing = resolution or node_spacing(task.arm, curves, windows, second=terms.second)
    unrolled = np.zeros(task.arm.dof, dtype=bool)
    if quick and count_nodes(task, curves, spacing) > OPTIONS.quick_nodes:
        limit = OPTIONS.quick_nodes
        raise InvalidInput(f"grid_oracle: quick=True must have at most {limit} nodes, got more, {spacing:g} rad apart")
    while True:  # the best path
        grid = _feasible_grid(level, posture_grid(level, curves, spacing, windows, unrolled), terms)
        layers = (_pair_graph if terms.second else _node_graph)(level, grid, terms)
        layers = layers.prune([np.isfinite(cost) for cost in layers.costs], layers.start)
        best, states = shortest_path(layers, level.cyclic)
        if not len(states):
            raise _no_path_error(level, layers, spacing)
        q = grid.motion(layers.node_path(states))
        wound = level.cyclic & level.arm.periodic & (np.abs(q[-1] - q[0]) > 1.0)
        if not wound.any():
            break
        unrolled |= wound  # the best cycle ends whole turns away from its start: keep turns of these joints apart
    paths = [states, *distinct_paths(layers, level.cyclic, round(OPTIONS.distinct / spacing))]
    motions = np.stack([grid.motion(layers.node_path(path)) for path in paths])
    selection = _select_paths(task, level, grid, terms, motions, classes)
    if not terms.second and not np.isclose(selection["values"][0], best, rtol=1e-6, atol=0):
        raise InvalidInput("grid_oracle: objectives and limits must look at the postures and rates of one sample alone")
    bound = np.nan  # lower bound of all motions
    if not quick and not terms.second:
        every = posture_grid(level, curves, spacing, windows, unrolled, beyond=OPTIONS.margin * spacing)
        bound = lower_bound(level, every, terms, spacing)
    return GridOracle(
        **selection, resolution=spacing, samples=len(level.times), exact=not terms.second, lower_bound=bound
    )


def _node_graph(task: MotionTask, grid: PostureGrid, terms: Terms) -> LayeredGraph:
    pairs, at = transitions(task, grid)
    counts = [len(sources) for sources, _ in pairs]
    return build_graph(grid, pairs, evaluate_at(task, terms.feasible_costs, counts, at))


def _pair_graph(task: MotionTask, grid: PostureGrid, terms: Terms) -> LayeredGraph:
    """Return the graph of pairs of consecutive nodes.

    A joint's speed changes by at most half its range in a step.
    """
    nodes, steps, first = grid.nodes, np.diff(task.times, prepend=np.nan), 0 if task.cyclic else 1
    pairs = [grid.edges(i) for i in range(1, len(nodes))]
    dq = [grid.step(nodes[i + 1][b], nodes[i][a]) / steps[i + 1] for i, (a, b) in enumerate(pairs)]
    pairs.insert(0, pairs[-1] if task.cyclic else pairs[0])
    dq.insert(0, dq[-1] if task.cyclic else np.zeros_like(dq[0]))
    transitions_of = [(np.zeros(0, dtype=int),) * 2]
    for i in range(1, len(nodes)):
        if i > first:
            # all pairs (first, second) whose second begins at the end of the first, sorted by the first's end
            begins = pairs[i][0]
            low, high = (np.searchsorted(pairs[i - 1][1], begins, side=side) for side in ("left", "right"))
            ends = np.repeat(np.arange(len(begins)), high - low)
            sources = np.arange(len(ends)) - np.repeat(np.cumsum(high - low) - high, high - low)
        else:
            sources, ends = (np.arange(len(dq[1])),) * 2
        near = np.abs(dq[i][ends] - dq[i - 1][sources]) * steps[i] <= grid.windows[i] / 2
        transitions_of.append((sources[near.all(axis=1)], ends[near.all(axis=1)]) if i > first else (sources, ends))

    def at(i: int, pick: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        sources, ends = transitions_of[i]
        if not len(ends):
            return grid.at_rest(i, np.zeros_like(pick))
        here = dq[i][ends[pick]]
        return nodes[i][pairs[i][1][ends[pick]]], here, (here - dq[i - 1][sources[pick]]) / steps[i]

    costs = evaluate_at(task, terms.feasible_costs, [len(sources) for sources, _ in transitions_of], at)
    return LayeredGraph(
        start=np.zeros(len(dq[0])) if task.cyclic else costs[1],
        offsets=[
            np.searchsorted(transitions_of[i][1], np.arange(len(dq[i]) + 1)) for i in range(1 + first, len(nodes))
        ],
        sources=[sources for sources, _ in transitions_of[1 + first :]],
        costs=costs[1 + first :],
        nodes=[ends for _, ends in pairs[first:]],
        before=None if task.cyclic else pairs[1][0],
    )


def _feasible_grid(task: MotionTask, grid: PostureGrid, terms: Terms) -> PostureGrid:
    """Return the grid of the nodes that satisfy the limits on postures."""

    def satisfies(motion: Motion) -> np.ndarray:
        satisfied = np.asarray(terms.postures(motion) <= LIMIT_TOLERANCE)
        if not task.cyclic:
            satisfied[:, 0] &= (terms.rates(motion) <= LIMIT_TOLERANCE)[:, 0]  # the motion begins at rest
        return satisfied

    feasible = [there > 0 for there in evaluate_at(task, satisfies, [len(there) for there in grid.nodes], grid.at_rest)]
    if task.cyclic:
        feasible[0] = feasible[-1] = feasible[0] & feasible[-1]
    for i, k in enumerate(feasible):
        if not k.any():
            raise Infeasible(
                f"no posture satisfies the limits at sample {i} of {len(feasible)} ({task.times[i]:.3g} s)"
            )
    return grid.select(feasible)


def _select_paths(
    task: MotionTask, level: MotionTask, grid: PostureGrid, terms: Terms, paths: np.ndarray, classes: int
) -> dict[str, Any]:
    """Return the best motion of every class, and distant motions.

    The best is by value on the grid.
    """
    if task.cyclic:
        paths = paths[np.abs((paths[:, -1] - paths[:, 0]) / grid.scales).max(axis=1) < 1e-6]
    motions = level.motion(paths)
    cost, kinds = motions.integral(terms.cost(motions)), branch_labels(motions)
    change = paths[:, -1] - paths[:, 0]
    turns = np.round((change - grid.step(paths[:, -1], paths[:, 0])) / (2 * np.pi)).astype(int)
    selected: dict[int, np.ndarray] = {}
    for far in (False, True):  # classes first, so that no distant motion takes the place of a class
        for k in np.argsort(cost, kind="stable").tolist():
            indices = list(selected)
            is_known = any(kinds[k] == kinds[j] and (turns[k] == turns[j]).all() for j in indices)
            square = np.sum((grid.step(paths[k], paths[indices]) / grid.scales) ** 2, axis=-1)
            distance = np.sqrt(np.mean(square, axis=-1)).min(initial=np.inf)
            chosen = distance > OPTIONS.distinct if far else not is_known
            if len(indices) < classes and chosen:
                with suppress(Infeasible):  # the motion leaves the path between its samples
                    # on all samples if possible
                    motion = motions[k]
                    if len(motion.time) == len(task.times):
                        selected[int(k)] = motion.q
                    else:
                        q = motion.at(task.times)
                        if task.start is not None:
                            q[0] = task.start
                        selected[int(k)] = q
    order = sorted(selected, key=lambda k: cost[k])
    if not order:
        raise Infeasible(f"every path through the grid of {len(level.times)} samples leaves the path between them")
    final = task.motion(np.stack([selected[k] for k in order]))
    return {
        "q": final.q,
        "values": final.integral(terms.cost(final)),
        "violations": task.violations(final).max(axis=1, initial=0.0),
        "labels": tuple(kinds[k] for k in order),
    }


def _no_path_error(task: MotionTask, layers: LayeredGraph, spacing: float) -> Infeasible:
    """Return the error, which names the sample that paths reach."""
    reached = [np.isfinite(value).any() for value in layers.forward(layers.start)]
    if all(reached):
        return Infeasible(
            "no path through the grid is closed: every one that satisfies the limits ends in another posture"
        )
    i = len(task.times) - len(reached) + reached.index(False)
    return Infeasible(
        f"no path through the grid, its nodes {spacing:.3g} rad apart, comes to sample {i} of {len(task.times)} "
        f"({task.times[i]:.3g} s) within the limits"
    )

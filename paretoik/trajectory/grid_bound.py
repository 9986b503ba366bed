"""A lower bound on all motions, where redundancy is one and accelerations don't count.

A motion runs within cells: between two neighbouring nodes at every sample. Let every sample be rounded, by itself, to
one of its two nodes, with the chances that make the mean the motion's own place. The mean cost of what comes out is the
sum of each transition's cost interpolated between the corners of its cell, which exceeds the motion's own cost by no
more than the interpolation's error. Some rounding costs no more than the mean. So the best path through the grid, with
that error taken off every transition and limits relaxed by what they change within a cell, is a bound from below.

The error is taken from second differences D between neighbouring transitions, those of all cells around one: where
costs are smooth it is an eighth of the largest; where they have a kink, and are convex along the curves, half of it.
There D jumps from node to node, so that ⅛ max D + ⅜ (max D − min D) holds for both. What limits change within a cell is
taken from first differences.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paretoik.task.limits import LIMIT_TOLERANCE
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.grid_terms import OPTIONS, Terms, evaluate_at
from paretoik.trajectory.layered_graph import shortest_path
from paretoik.trajectory.posture_grid import PostureGrid, build_graph, transitions


def lower_bound(task: MotionTask, grid: PostureGrid, terms: Terms, spacing: float) -> float:
    """Return a bound from below on every motion within the grid's windows; infinite where limits leave none.

    ``grid`` is of all nodes, those that do not keep the limits included, a few beyond the joints' ranges.
    """
    wide = replace(grid, windows=grid.windows + OPTIONS.margin * spacing * grid.scales)
    pairs, edge = transitions(task, wide)
    counts = [len(sources) for sources, _ in pairs]
    costs = evaluate_at(task, terms.sample_costs, counts, edge)
    rates = evaluate_at(task, terms.worst(terms.rates), counts, edge)
    postures = evaluate_at(task, terms.worst(terms.postures), [len(q) for q in grid.nodes], grid.at_rest)
    nodes = [_may_satisfy(excess, [_neighbours(ahead)]) for excess, ahead in zip(postures, grid.next_node, strict=True)]
    masks = []
    for i, (sources, ends) in enumerate(pairs[1:], 1):
        around = _neighbouring_transitions(sources, ends, grid.next_node[i - 1], grid.next_node[i])
        costs[i] -= sum(_interpolation_error(_second_difference(costs[i], pair), around) for pair in around)
        steps = np.abs(grid.step(grid.nodes[i][ends], grid.nodes[i - 1][sources]))
        near = steps <= grid.windows[i] + OPTIONS.cell * spacing * grid.scales
        masks.append(near.all(axis=1) & nodes[i - 1][sources] & nodes[i][ends] & _may_satisfy(rates[i], around))
    layers = build_graph(grid, pairs, costs).prune(masks, np.where(nodes[0], 0.0, np.inf))
    return shortest_path(layers, task.cyclic)[0]


Pair = tuple[np.ndarray, np.ndarray]  # where the neighbours on either side are, −1 where there is none


def _neighbours(ahead: np.ndarray) -> Pair:
    """Return the nodes after and before each on its curve."""
    behind = np.full(len(ahead), -1)
    inner = np.flatnonzero(ahead >= 0)
    behind[ahead[inner]] = inner
    return ahead, behind


def _neighbouring_transitions(
    sources: np.ndarray, ends: np.ndarray, before: np.ndarray, here: np.ndarray
) -> list[Pair]:
    """Return the transitions beside each: with the next and the last source, and with the next and the last end."""
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


def _interpolation_error(second_differences: np.ndarray, around: list[Pair]) -> np.ndarray:
    """Return the largest error of interpolation within the cells around, by second differences."""
    convex = np.maximum(second_differences, 0.0)  # of NaN: NaN
    largest, smallest = _neighbourhood_max(convex, around), -_neighbourhood_max(-convex, around)
    return np.where(largest >= smallest, largest / 8 + 3 / 8 * (largest - smallest), 0.0)


def _second_difference(values: np.ndarray, pair: Pair) -> np.ndarray:
    """Return second differences, NaN where a neighbour is missing."""
    after, before = pair
    return np.where((after >= 0) & (before >= 0), values[after] + values[before] - 2 * values, np.nan)


def _first_difference(values: np.ndarray, pair: Pair) -> np.ndarray:
    """Return how much values differ from their neighbours', at most."""
    return np.max([np.where(side >= 0, np.abs(values[side] - values), 0.0) for side in pair], axis=0)


def _neighbourhood_max(values: np.ndarray, around: list[Pair]) -> np.ndarray:
    """Return the largest of values and of those all around them that are known, NaN where none is."""
    for pair in around:
        values = np.fmax.reduce([values, *(np.where(side >= 0, values[side], np.nan) for side in pair)])
    return values


def _may_satisfy(excess: np.ndarray, around: list[Pair]) -> np.ndarray:
    """Return where limits may hold within a cell beside."""
    margin = sum(_neighbourhood_max(_first_difference(excess, pair), around) for pair in around)
    return excess <= LIMIT_TOLERANCE + margin

"""Shortest paths through layers of states and their transitions, by dynamic programming (Bellman 1957)."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import minimum_filter1d

from paretoik.stop_flag import check_interruption


@dataclass(frozen=True, kw_only=True, eq=False)
class LayeredGraph:
    """A layered graph of states and transitions, sorted by their ends."""

    start: np.ndarray  # costs of the first states
    offsets: list[np.ndarray]  # index (states + 1) of the first transition to each state
    sources: list[np.ndarray]  # states in which transitions begin
    costs: list[np.ndarray]
    nodes: list[np.ndarray]  # node of every state
    before: np.ndarray | None = None  # first node of every first state, if states are pairs of nodes

    def forward(self, start: np.ndarray) -> list[np.ndarray]:
        """Return the least cost to every state: V(end) = min V(source) + cost."""
        costs_to_come = [start]
        for offsets, sources, costs in zip(self.offsets, self.sources, self.costs, strict=True):
            check_interruption()
            value, reached = np.full(len(offsets) - 1, np.inf), np.diff(offsets) > 0
            if len(costs):
                value[reached] = np.minimum.reduceat(costs_to_come[-1][sources] + costs, offsets[:-1][reached])
            costs_to_come.append(value)
        return costs_to_come

    def backward(self) -> list[np.ndarray]:
        """Return the least cost from every state: V(source) = min cost + V(end)."""
        costs_to_go = [np.zeros(len(self.nodes[-1]))]
        for step in reversed(range(len(self.costs))):
            value = np.full(len(self.nodes[step]), np.inf)
            cost = np.repeat(costs_to_go[0], np.diff(self.offsets[step])) + self.costs[step]
            np.minimum.at(value, self.sources[step], cost)
            costs_to_go.insert(0, value)
        return costs_to_go

    def path_through(
        self, cost_to_come: list[np.ndarray], cost_to_go: list[np.ndarray], layer: int, state: int
    ) -> list[int]:
        """Return the shortest path through a state, as one state per layer."""
        states = [state]
        for step in reversed(range(layer)):
            part = slice(*self.offsets[step][states[0] : states[0] + 2])
            sources = self.sources[step][part]
            states.insert(0, int(sources[np.argmin(cost_to_come[step][sources] + self.costs[step][part])]))
        for step in range(layer, len(self.costs)):
            leaving = np.flatnonzero(self.sources[step] == states[-1])
            ends = np.searchsorted(self.offsets[step], leaving, side="right") - 1
            states.append(int(ends[np.argmin(self.costs[step][leaving] + cost_to_go[step + 1][ends])]))
        return states

    def node_path(self, states: Sequence[int]) -> list[int]:
        """Return the nodes of a path, one per sample."""
        first = [] if self.before is None else [int(self.before[states[0]])]
        return first + [int(nodes[state]) for nodes, state in zip(self.nodes, states, strict=True)]

    def prune(self, mask: list[np.ndarray], start: np.ndarray) -> LayeredGraph:
        """Return the graph with only transitions of ``mask``, and new first costs."""
        ends = [np.repeat(np.arange(len(o) - 1), np.diff(o))[k] for o, k in zip(self.offsets, mask, strict=True)]
        return replace(
            self,
            start=start,
            offsets=[np.searchsorted(e, np.arange(len(o))) for e, o in zip(ends, self.offsets, strict=True)],
            sources=[s[k] for s, k in zip(self.sources, mask, strict=True)],
            costs=[c[k] for c, k in zip(self.costs, mask, strict=True)],
        )


def shortest_path(layers: LayeredGraph, cyclic: bool, among: np.ndarray | None = None) -> tuple[float, list[int]]:
    """Return the least cost and its path, or inf and [].

    Cycles are found by branch and bound over sets of first states: the shortest path from a set back to this set is a
    lower bound of the set's cycles.
    """
    first_states = np.arange(len(layers.start)) if among is None else among

    def relaxation(first: np.ndarray) -> tuple[float, list[int]]:
        start = np.full(len(layers.start), np.inf)
        start[first] = layers.start[first]
        cost_to_come = layers.forward(start)
        end = int(first[np.argmin(cost_to_come[-1][first])] if cyclic else np.argmin(cost_to_come[-1]))
        value = float(cost_to_come[-1][end])
        return value, layers.path_through(cost_to_come, [], len(cost_to_come) - 1, end) if np.isfinite(value) else []

    value, states = relaxation(first_states)
    if not cyclic or not states or states[0] == states[-1]:
        return value, states
    upper = min(relaxation(np.array([states[k]]))[0] for k in (0, -1))
    if np.isfinite(upper):
        layers = prune_costly(layers, upper)
    queue, count = [(value, 0, first_states, states)], 1  # the count breaks ties, because arrays cannot be compared
    while queue:
        value, _, first, states = heapq.heappop(queue)
        if states[0] == states[-1]:
            return value, states
        ends = np.searchsorted(first, sorted((states[0], states[-1])))
        middle = int(ends.sum() + 1) // 2
        for part in (first[:middle], first[middle:]):
            value, states = relaxation(part)
            if states:
                heapq.heappush(queue, (value, count, part, states))
                count += 1
    return np.inf, []


def prune_costly(layers: LayeredGraph, upper: float) -> LayeredGraph:
    """Return the graph without transitions whose paths all cost more than ``upper``."""
    cost_to_come, cost_to_go, mask = layers.forward(layers.start), layers.backward(), []
    for step, offsets in enumerate(layers.offsets):
        cost = cost_to_come[step][layers.sources[step]] + layers.costs[step]
        mask.append(cost + np.repeat(cost_to_go[step + 1], np.diff(offsets)) <= upper * (1 + 1e-9))
    return layers.prune(mask, layers.start)


def distinct_paths(layers: LayeredGraph, cyclic: bool, nearby: int, *, inspected: int = 5) -> list[list[int]]:
    """Return the shortest paths through distinct nodes of ``inspected`` layers.

    A node counts if no path through nodes at most ``nearby`` away is shorter.
    """
    cost_to_come, cost_to_go, paths = layers.forward(layers.start), layers.backward(), list[list[int]]()
    last = len(layers.nodes) - 1
    for layer in [0] if cyclic else np.unique(np.linspace(0, last, inspected).astype(int)).tolist():
        through, nodes = cost_to_come[layer] + cost_to_go[layer], layers.nodes[layer]
        node_cost = np.full(int(nodes.max()) + 1, np.inf)
        np.minimum.at(node_cost, nodes, through)
        valleys = np.isfinite(node_cost) & (node_cost == minimum_filter1d(node_cost, 2 * nearby + 1))
        for node in np.flatnonzero(valleys):
            check_interruption()
            states = np.flatnonzero(nodes == node)
            if cyclic:
                paths.append(shortest_path(layers, cyclic, states)[1])
            else:
                state = int(states[np.argmin(through[states])])
                paths.append(layers.path_through(cost_to_come, cost_to_go, layer, state))
    return [path for path in paths if path]

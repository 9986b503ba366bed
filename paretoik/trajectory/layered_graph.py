"""Layers of states and the transitions between them: the best ways through, by dynamic programming.

Source: Bellman 1957.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import minimum_filter1d

LOOKED_AT = 5  # samples at which different ways are told apart


@dataclass(frozen=True, kw_only=True, eq=False)
class Layers:
    """A layered graph: ``start`` costs, and per step all transitions, sorted by the state that they end in.

    ``offsets`` (states + 1) says which end where, ``sources`` where they begin; ``nodes`` is the node of every state,
    ``before`` the one of the sample before the first layer, where states are pairs.
    """

    start: np.ndarray
    offsets: list[np.ndarray]
    sources: list[np.ndarray]
    costs: list[np.ndarray]
    nodes: list[np.ndarray]
    before: np.ndarray | None = None

    def forward(self, start: np.ndarray) -> list[np.ndarray]:
        """Return the least cost of coming to every state of every layer."""
        found = [start]
        for offsets, sources, costs in zip(self.offsets, self.sources, self.costs, strict=True):
            value, reached = np.full(len(offsets) - 1, np.inf), np.diff(offsets) > 0
            if len(costs):
                value[reached] = np.minimum.reduceat(found[-1][sources] + costs, offsets[:-1][reached])
            found.append(value)
        return found

    def backward(self) -> list[np.ndarray]:
        """Return the least cost of going on from every state of every layer."""
        found = [np.zeros(len(self.nodes[-1]))]
        for step in reversed(range(len(self.costs))):
            value = np.full(len(self.nodes[step]), np.inf)
            onward = np.repeat(found[0], np.diff(self.offsets[step])) + self.costs[step]
            np.minimum.at(value, self.sources[step], onward)
            found.insert(0, value)
        return found

    def way(self, came: list[np.ndarray], onward: list[np.ndarray], layer: int, state: int) -> list[int]:
        """Return the best way through a state, as a state of every layer."""
        states = [state]
        for step in reversed(range(layer)):
            part = slice(*self.offsets[step][states[0] : states[0] + 2])
            sources = self.sources[step][part]
            states.insert(0, int(sources[np.argmin(came[step][sources] + self.costs[step][part])]))
        for step in range(layer, len(self.costs)):
            leaving = np.flatnonzero(self.sources[step] == states[-1])
            ends = np.searchsorted(self.offsets[step], leaving, side="right") - 1
            states.append(int(ends[np.argmin(self.costs[step][leaving] + onward[step + 1][ends])]))
        return states

    def through(self, states: Sequence[int]) -> list[int]:
        """Return the nodes of a way, one a sample."""
        first = [] if self.before is None else [int(self.before[states[0]])]
        return first + [int(nodes[state]) for nodes, state in zip(self.nodes, states, strict=True)]

    def thinned(self, kept: list[np.ndarray], start: np.ndarray) -> Layers:
        """Return the graph with only the transitions kept, and other costs of the first states."""
        ends = [np.repeat(np.arange(len(o) - 1), np.diff(o))[k] for o, k in zip(self.offsets, kept, strict=True)]
        return replace(
            self,
            start=start,
            offsets=[np.searchsorted(e, np.arange(len(o))) for e, o in zip(ends, self.offsets, strict=True)],
            sources=[s[k] for s, k in zip(self.sources, kept, strict=True)],
            costs=[c[k] for c, k in zip(self.costs, kept, strict=True)],
        )


def best_way(layers: Layers, cyclic: bool, among: np.ndarray | None = None) -> tuple[float, list[int]]:
    """Return the least cost and its way, a closed one of a cycle; no way where there is none.

    Cycles by branch and bound over sets of first states: the best way from a set back into it bounds its cycles.
    """
    everywhere = np.arange(len(layers.start)) if among is None else among

    def bounded(first: np.ndarray) -> tuple[float, list[int]]:
        start = np.full(len(layers.start), np.inf)
        start[first] = layers.start[first]
        came = layers.forward(start)
        end = int(first[np.argmin(came[-1][first])] if cyclic else np.argmin(came[-1]))
        value = float(came[-1][end])
        return value, layers.way(came, [], len(came) - 1, end) if np.isfinite(value) else []

    value, states = bounded(everywhere)
    if not cyclic or not states or states[0] == states[-1]:
        return value, states
    worth = min(bounded(np.array([states[k]]))[0] for k in (0, -1))
    if np.isfinite(worth):
        layers = promising(layers, worth)
    queue, count = [(value, 0, everywhere, states)], 1  # counted: arrays don't compare
    while queue:
        value, _, first, states = heapq.heappop(queue)
        if states[0] == states[-1]:
            return value, states
        ends = np.searchsorted(first, sorted((states[0], states[-1])))
        middle = int(ends.sum() + 1) // 2
        for part in (first[:middle], first[middle:]):
            value, states = bounded(part)
            if states:
                heapq.heappush(queue, (value, count, part, states))
                count += 1
    return np.inf, []


def promising(layers: Layers, worth: float) -> Layers:
    """Return the graph without the transitions that no way at most so expensive takes."""
    came, onward, kept = layers.forward(layers.start), layers.backward(), []
    for step, offsets in enumerate(layers.offsets):
        least = came[step][layers.sources[step]] + layers.costs[step]
        kept.append(least + np.repeat(onward[step + 1], np.diff(offsets)) <= worth * (1 + 1e-9))
    return layers.thinned(kept, layers.start)


def ways_through(layers: Layers, cyclic: bool, nearby: int) -> list[list[int]]:
    """Return ways that are the best through a node and no worse than those through the nodes beside it."""
    came, onward, found = layers.forward(layers.start), layers.backward(), []
    last = len(layers.nodes) - 1
    for layer in [0] if cyclic else np.unique(np.linspace(0, last, LOOKED_AT).astype(int)).tolist():
        through, nodes = came[layer] + onward[layer], layers.nodes[layer]
        least = np.full(int(nodes.max()) + 1, np.inf)
        np.minimum.at(least, nodes, through)
        valleys = np.isfinite(least) & (least == minimum_filter1d(least, 2 * nearby + 1))
        for node in np.flatnonzero(valleys):
            states = np.flatnonzero(nodes == node)
            if cyclic:
                found.append(best_way(layers, cyclic, states)[1])
            else:
                found.append(layers.way(came, onward, layer, int(states[np.argmin(through[states])])))
    return [way for way in found if way]

"""Compiled OLGA: rank weighting, single-point crossover, replacement of one gene, and an elite of one.

Source: Marcos et al. 2012, section 4.2.
"""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run_first
from paretoik.compilation.numba_cache import compiled
from paretoik.search.offspring import next_bits, seed_stream, uniform, upper_integer
from paretoik.search.sorted_points import merge_sort


@compiled(what="the search for a start posture", seconds=5)
def search_posture(seed, options, lower, upper, evaluator, w):
    """Search joint positions with the least task error, first in ``w.order``; return their clearance violation.

    The arguments are those of ``open_loop.py``.
    """
    dof, count = w.parents.shape
    seed_stream(w.state, seed, 0)
    for k in range(count):
        for j in range(dof):
            w.parents[j, k] = lower[j] + (upper[j] - lower[j]) * uniform(w.state)
    run_first(evaluator, w.parents, w.parent_values, count)
    _sort(w.parent_values, w)
    for _ in range(1, options.generations):
        for k in range(0, count, 2):
            # children k and k + 1 of two parents; if the number is odd, the last child has no sibling
            mother, father = _select(w), _select(w)
            crosses = uniform(w.state) < options.crossover_probability
            bits = next_bits(w.state)
            cut = dof if not crosses else (1 + upper_integer(bits, dof - 1) if dof > 1 else upper_integer(bits, 2))
            for child in range(k, min(k + 2, count)):
                for j in range(dof):
                    w.children[j, child] = w.parents[j, mother if j < cut else father]
                if uniform(w.state) < options.mutation_probability:
                    j = upper_integer(next_bits(w.state), dof)
                    w.children[j, child] = lower[j] + (upper[j] - lower[j]) * uniform(w.state)
                mother, father = father, mother
        run_first(evaluator, w.children, w.child_values, count)
        # make the children the parents; the best parent replaces the worst child
        best = w.order[0]
        _sort(w.child_values, w)
        worst = w.order[count - 1]
        for k in range(count):
            if k == best:  # the elite keeps its column; the child there moves to the worst child's column
                continue
            child = best if k == worst else k
            for j in range(dof):
                w.parents[j, k] = w.children[j, child]
            for m in range(2):
                w.parent_values[m, k] = w.child_values[m, child]
        _sort(w.parent_values, w)
    return w.parent_values[0, w.order[0]]


@compiled
def _sort(values, w):
    """Write the individuals in order, by violation, then by error; NaN is worst."""
    count = w.order.shape[0]
    for k in range(count):
        w.order[k] = k
        for m in range(2):
            w.sorted_values[m, k] = values[m, k] if values[m, k] == values[m, k] else np.inf
    merge_sort(w.order, w.sorted_values, 0, count, w.spare)


@compiled
def _select(w):
    """Return an individual by rank weighting. Source: Haupt & Haupt 2004, section 2.2.4.

    The k-th best of N has the probability 2 (N − k + 1) / (N (N + 1)), the first k have k (2N + 1 − k) / (N (N + 1)).
    """
    count = w.order.shape[0]
    b = 2.0 * count + 1.0
    place = np.int64(0.5 * (b - np.sqrt(b * b - 4.0 * uniform(w.state) * count * (count + 1.0))))
    return w.order[min(place, count - 1)]

"""Offspring, compiled: tournaments, crossover by rows, one gene replaced. The operators of ``search/rowwise`` in words.

A population is in ``order``: place after place its row of genes, with its ``worth`` in a tournament by place.
"""

from __future__ import annotations

import numpy as np

from paretoik.calculus.compiling import compiled
from paretoik.search.compiled.chance import bits, lower, share, upper

DECIDING = 1 << 32  # what half of some bits is compared with


@compiled
def winner(state, worth, count):
    """Return the place of the better of two drawn ones; of equals the first drawn."""
    drawn = bits(state)
    first, second = upper(drawn, count), lower(drawn, count)
    return first if worth[first] >= worth[second] else second


@compiled
def offspring(state, genes, order, worth, F, row, crossing, mutating, low, high, pair, children):
    """Fill ``children`` (genes, places) with the offspring of ``genes`` (rows, genes), rows of ``row`` genes each.

    Return how many are new; the others, at the end, are copies of a parent and get its objectives: ``F`` (objectives,
    points) has those of the parents by place, then those of the children. What chance decides is written without
    branches: a processor cannot foretell it.
    """
    size, count, parents = genes.shape[1], children.shape[1], order.shape[0]
    new, last = 0, count - 1
    for made in range(0, count, 2):
        place, other_place = winner(state, worth, parents), winner(state, worth, parents)
        mother, father = order[place], order[other_place]
        drawn, exchanged = bits(state), False
        idle = np.int64(lower(drawn, DECIDING) >= crossing * DECIDING)
        for begun in range(0, size, row):
            cut = max(1 + upper(drawn, row - 1), row * idle)
            drawn = bits(state)
            for k in range(row):
                first, second, crossed = genes[mother, begun + k], genes[father, begun + k], k >= cut
                exchanged |= crossed & (first != second)
                pair[0, begun + k] = second if crossed else first
                pair[1, begun + k] = first if crossed else second
        for child in range(min(2, count - made)):
            drawn, value = bits(state), low + (high - low) * share(state)
            mutated = lower(drawn, DECIDING) < mutating * DECIDING
            gene = upper(drawn, size)
            pair[child, gene] = value if mutated else pair[child, gene]
            changed = np.int64(mutated | exchanged)
            lane = changed * new + (1 - changed) * last
            for k in range(size):
                children[k, lane] = pair[child, k]
            for m in range(F.shape[0]):
                F[m, parents + lane] = F[m, place]
            new += changed
            last -= 1 - changed
            place = other_place
    return new


@compiled
def anew(state, low, high, children, child):
    """Replace all genes of a child by chance."""
    for k in range(children.shape[0]):
        children[k, child] = low + (high - low) * share(state)

"""Offspring, compiled: tournaments, crossover by rows, one gene replaced. The operators of ``search/rowwise`` in words.

A population is in ``order``: place after place its row of genes, with its ``worth`` in a tournament by place.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled
from paretoik.search.compiled.chance import bits, lower, share, upper

DECIDING = 1 << 32  # what half of some bits is compared with


@compiled
def winner(state, worth, count):
    """Return the place of the better of two drawn ones; of equals the first drawn."""
    drawn = bits(state)
    first, second = upper(drawn, count), lower(drawn, count)
    return first if worth[first] >= worth[second] else second


@compiled
def offspring(state, genes, order, worth, F, row, crossing, mutating, low, high, children):
    """Fill ``children`` (genes, places) with the offspring of ``genes`` (rows, genes), rows of ``row`` genes each.

    Return how many are new; the others, at the end, are copies of a parent and have its objectives: ``F`` (objectives,
    points) has those of the parents by place, then those of the children. What chance decides is written without
    branches: a processor cannot foretell it.
    """
    size, count, parents = genes.shape[1], children.shape[1], order.shape[0]
    new, last = 0, count - 1
    for made in range(0, count, 2):
        place, other_place = winner(state, worth, parents), winner(state, worth, parents)
        mother, father = order[place], order[other_place]
        drawn, one_drawn, other_drawn = bits(state), bits(state), bits(state)
        crossed = np.int64(lower(drawn, DECIDING) < crossing * DECIDING)
        mutated = np.int64(lower(one_drawn, DECIDING) < mutating * DECIDING)
        other_mutated = np.int64(lower(other_drawn, DECIDING) < mutating * DECIDING)
        changed, other_changed = crossed | mutated, crossed | other_mutated
        one = changed * new + (1 - changed) * last
        new, last = new + changed, last - (1 - changed)
        other = other_changed * new + (1 - other_changed) * last
        if made + 1 == count:
            other = one
        else:
            new, last = new + other_changed, last - (1 - other_changed)
        for begun in range(0, size, row):
            cut = crossed * (1 + upper(drawn, row - 1)) + (1 - crossed) * row
            drawn = bits(state)
            for k in range(row):
                first, second = genes[mother, begun + k], genes[father, begun + k]
                children[begun + k, other] = first if k >= cut else second
                children[begun + k, one] = second if k >= cut else first
        for m in range(F.shape[0]):
            F[m, parents + other] = F[m, other_place]
            F[m, parents + one] = F[m, place]
        if made + 1 < count:
            gene, value = upper(other_drawn, size), low + (high - low) * share(state)
            children[gene, other] = value if other_mutated else children[gene, other]
        gene, value = upper(one_drawn, size), low + (high - low) * share(state)
        children[gene, one] = value if mutated else children[gene, one]
    return new


@compiled
def anew(state, low, high, children, child):
    """Replace all genes of a child by chance."""
    for k in range(children.shape[0]):
        children[k, child] = low + (high - low) * share(state)

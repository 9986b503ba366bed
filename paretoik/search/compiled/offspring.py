"""Offspring, compiled: tournaments, crossover by rows, one gene replaced (Marcos et al. 2012, section 4.1).

A population stands in ``order``: place after place its row of ``genes``, with its ``fitness`` in a tournament by place.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled
from paretoik.search.compiled.random_streams import lower_integer, next_bits, uniform, upper_integer

HALF_RANGE = 1 << 32  # of the integers that half of 64 bits stands for


@compiled
def tournament(state, fitness, count):
    """Return the place of the fitter of two that are drawn; of equals the first."""
    bits = next_bits(state)
    first, second = upper_integer(bits, count), lower_integer(bits, count)
    return first if fitness[first] >= fitness[second] else second


@compiled
def generate_offspring(
    state, genes, order, fitness, F, row_size, crossover_probability, mutation_probability, lower, upper, children
):
    """Fill ``children`` (genes, places) with the offspring of ``genes`` (rows, genes), in rows of ``row_size`` genes.

    Return how many are new; the others, at the end, are copies of a parent and have its objectives: ``F`` (objectives,
    points) holds those of the parents by place, then those of the children. Random decisions are arithmetic instead of
    branches, which a processor cannot predict.
    """
    size, count, parents = genes.shape[1], children.shape[1], order.shape[0]
    new, last = 0, count - 1
    for k in range(0, count, 2):
        mother_place, father_place = tournament(state, fitness, parents), tournament(state, fitness, parents)
        mother, father = order[mother_place], order[father_place]
        bits, first_bits, second_bits = next_bits(state), next_bits(state), next_bits(state)
        crossed = np.int64(lower_integer(bits, HALF_RANGE) < crossover_probability * HALF_RANGE)
        first_mutated = np.int64(lower_integer(first_bits, HALF_RANGE) < mutation_probability * HALF_RANGE)
        second_mutated = np.int64(lower_integer(second_bits, HALF_RANGE) < mutation_probability * HALF_RANGE)
        first_changed, second_changed = crossed | first_mutated, crossed | second_mutated
        first = first_changed * new + (1 - first_changed) * last
        new, last = new + first_changed, last - (1 - first_changed)
        second = second_changed * new + (1 - second_changed) * last
        if k + 1 == count:
            second = first
        else:
            new, last = new + second_changed, last - (1 - second_changed)
        for row in range(0, size, row_size):
            cut = crossed * (1 + upper_integer(bits, row_size - 1)) + (1 - crossed) * row_size
            bits = next_bits(state)
            for j in range(row_size):
                of_mother, of_father = genes[mother, row + j], genes[father, row + j]
                children[row + j, second] = of_mother if j >= cut else of_father
                children[row + j, first] = of_father if j >= cut else of_mother
        for m in range(F.shape[0]):
            F[m, parents + second] = F[m, father_place]
            F[m, parents + first] = F[m, mother_place]
        if k + 1 < count:
            gene, value = upper_integer(second_bits, size), lower + (upper - lower) * uniform(state)
            children[gene, second] = value if second_mutated else children[gene, second]
        gene, value = upper_integer(first_bits, size), lower + (upper - lower) * uniform(state)
        children[gene, first] = value if first_mutated else children[gene, first]
    return new


@compiled
def draw_chromosome(state, lower, upper, children, child):
    """Draw all genes of a child from the uniform distribution."""
    for j in range(children.shape[0]):
        children[j, child] = lower + (upper - lower) * uniform(state)

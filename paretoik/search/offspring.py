"""Offspring, compiled: tournaments, crossover by rows, replacement of one gene (Marcos et al. 2012, section 4.1).

``order`` has the row of ``genes`` for each place of a population, ``fitness`` the fitness of each place.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation.numba_cache import compiled
from paretoik.search.sorted_points import ONE, ZERO

# Random numbers in streams: the k-th number of a stream depends only on its key and k. SplitMix64 (Steele, Lea & Flood
# 2014): a counter with mixed bits. A state is an array of one unsigned integer.


# the golden gamma, both factors, and a mask of the lower half
GAMMA, FIRST_FACTOR, SECOND_FACTOR, LOWER_HALF = (
    np.uint64(number) for number in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB, 0xFFFFFFFF)
)
U11, U27, U30, U31, U32 = np.uint64(11), np.uint64(27), np.uint64(30), np.uint64(31), np.uint64(32)


@compiled
def mix(z):
    """Return a number with its bits mixed."""
    z = (z ^ (z >> U30)) * FIRST_FACTOR
    z = (z ^ (z >> U27)) * SECOND_FACTOR
    return z ^ (z >> U31)


@compiled
def seed_stream(state, seed, step):
    """Set a state to the beginning of the stream for a seed and a step."""
    state[0] = mix(mix(np.uint64(seed) + GAMMA) ^ (np.uint64(step) * GAMMA))


@compiled
def next_bits(state):
    """Return the next 64 bits."""
    state[0] += GAMMA
    return mix(state[0])


@compiled
def draw_bits(state, numbers):
    """Write the next 64 bits to each of ``numbers`` (vectorised)."""
    origin = state[0]
    for k in range(numbers.shape[0]):
        numbers[k] = mix(origin + GAMMA * np.uint64(k + 1))
    state[0] = origin + GAMMA * np.uint64(numbers.shape[0])


@compiled
def uniform(state):
    """Return the next random number, uniform on [0, 1)."""
    return unit_number(next_bits(state))


@compiled
def unit_number(bits):
    """Return the number in [0, 1) that 64 bits represent."""
    return np.float64(bits >> U11) * 2.0**-53


@compiled
def upper_integer(bits, count):
    """Return the integer from 0 to ``count`` − 1 that the upper half of 64 bits represents."""
    return np.int64(((bits >> U32) * np.uint64(count)) >> U32)


@compiled
def lower_integer(bits, count):
    """Return the integer from 0 to ``count`` − 1 that the lower half of 64 bits represents."""
    return np.int64(((bits & LOWER_HALF) * np.uint64(count)) >> U32)


# Offspring: tournaments, crossover and replacement of a gene.


@compiled
def tournament(bits, fitness, count):
    """Return the place of the fitter of two random individuals; the first if equal.

    The 64 ``bits`` select the two among ``count`` places.
    """
    first, second = upper_integer(bits, count), lower_integer(bits, count)
    return first if fitness[first] >= fitness[second] else second


@compiled
def _decide(bits, probability):
    """Return 1 with a probability, else 0; unsigned, so that an index needs no sign check."""
    halves = 1 << 32  # number of integers that half of 64 bits represents
    return np.uint64(lower_integer(bits, halves) < probability * halves)


@compiled
def generate_offspring(state, genes, order, fitness, F, row_size, probabilities, bounds, children):
    """Write the offspring of ``genes`` (rows, genes) to ``children`` (genes, places); return the number of new ones.

    probabilities: those of crossover and of mutation
    bounds: lower and upper bound of replaced genes

    Crossover acts on rows of ``row_size`` genes. Unchanged children are at the end: copies of a parent with its
    objectives. ``F`` (objectives, points) has the objectives of the parents by place, then those of the children.
    Random decisions use arithmetic instead of branches, which a processor cannot predict.
    """
    (crossover_probability, mutation_probability), (lower, upper) = probabilities, bounds
    size, count, parents = np.uint64(genes.shape[1]), np.uint64(children.shape[1]), np.uint64(order.shape[0])
    length = np.uint64(row_size)
    rows, pairs, unpaired = size // length, count >> ONE, count & ONE
    draws = pairs * (rows + np.uint64(7)) + unpaired * (rows + np.uint64(6))
    numbers = np.empty(draws, np.uint64)
    draw_bits(state, numbers)
    new, last, drawn = ZERO, count - ONE, ZERO
    for pair in range(pairs + unpaired):
        mother_place = np.uint64(tournament(numbers[drawn], fitness, parents))
        father_place = np.uint64(tournament(numbers[drawn + ONE], fitness, parents))
        drawn += np.uint64(2)
        mother, father = np.uint64(order[mother_place]), np.uint64(order[father_place])
        bits, first_bits, second_bits = numbers[drawn], numbers[drawn + ONE], numbers[drawn + np.uint64(2)]
        drawn += np.uint64(3)
        crossed = _decide(bits, crossover_probability)
        first_mutated = _decide(first_bits, mutation_probability)
        second_mutated = _decide(second_bits, mutation_probability)
        first_changed, second_changed = crossed | first_mutated, crossed | second_mutated
        first = new if first_changed else last
        new, last = new + first_changed, last - (ONE - first_changed)
        if pair == pairs:
            second = first
        else:
            second = new if second_changed else last
            new, last = new + second_changed, last - (ONE - second_changed)
        gene = ZERO
        for _ in range(rows):
            cut = crossed * (ONE + np.uint64(upper_integer(bits, row_size - 1))) + (ONE - crossed) * length
            bits = numbers[drawn]
            drawn += ONE
            for j in range(length):
                of_mother, of_father = genes[mother, gene], genes[father, gene]
                children[gene, second] = of_mother if j >= cut else of_father
                children[gene, first] = of_father if j >= cut else of_mother
                gene += ONE
        for m in range(np.uint64(F.shape[0])):
            F[m, parents + second] = F[m, father_place]
            F[m, parents + first] = F[m, mother_place]
        if pair < pairs:
            _mutate(children, second, second_mutated, second_bits, numbers[drawn], lower, upper)
            drawn += ONE
        _mutate(children, first, first_mutated, first_bits, numbers[drawn], lower, upper)
        drawn += ONE
    return np.int64(new)


@compiled
def _mutate(children, child, mutated, bits, number, lower, upper):
    """Replace one gene of a child, which ``bits`` select, if ``mutated``."""
    gene = np.uint64(upper_integer(bits, children.shape[0]))
    value = lower + (upper - lower) * unit_number(number)
    children[gene, child] = value if mutated else children[gene, child]


@compiled
def draw_chromosome(state, lower, upper, children, child):
    """Write random genes of a child from the uniform distribution."""
    for j in range(children.shape[0]):
        children[j, child] = lower + (upper - lower) * uniform(state)

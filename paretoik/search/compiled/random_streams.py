"""Random numbers by streams: the k-th number of a stream depends on its key and on k alone.

SplitMix64 (Steele, Lea & Flood 2014): a counter whose bits are mixed. A state is an array of one unsigned integer.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled

GOLDEN_GAMMA = np.uint64(0x9E3779B97F4A7C15)
FIRST_FACTOR, SECOND_FACTOR = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
U11, U27, U30, U31, U32 = np.uint64(11), np.uint64(27), np.uint64(30), np.uint64(31), np.uint64(32)
LOWER_HALF = np.uint64(0xFFFFFFFF)


@compiled
def mix(z):
    """Return a number with its bits mixed."""
    z = (z ^ (z >> U30)) * FIRST_FACTOR
    z = (z ^ (z >> U27)) * SECOND_FACTOR
    return z ^ (z >> U31)


@compiled
def seed_stream(state, seed, step):
    """Set a state to the beginning of the stream of a seed and a step."""
    state[0] = mix(mix(np.uint64(seed) + GOLDEN_GAMMA) ^ (np.uint64(step) * GOLDEN_GAMMA))


@compiled
def next_bits(state):
    """Return the next 64 bits."""
    state[0] += GOLDEN_GAMMA
    return mix(state[0])


@compiled
def draw_bits(state, numbers):
    """Write the next 64 bits to each of ``numbers``: a processor mixes several at once."""
    origin = state[0]
    for k in range(numbers.shape[0]):
        numbers[k] = mix(origin + GOLDEN_GAMMA * np.uint64(k + 1))
    state[0] = origin + GOLDEN_GAMMA * np.uint64(numbers.shape[0])


@compiled
def uniform(state):
    """Return the next number of the uniform distribution on [0, 1)."""
    return unit_number(next_bits(state))


@compiled
def unit_number(bits):
    """Return the number of [0, 1) that 64 bits stand for."""
    return np.float64(bits >> U11) * 2.0**-53


@compiled
def upper_integer(bits, count):
    """Return the integer from 0 to below ``count`` that the upper half of 64 bits stands for."""
    return np.int64(((bits >> U32) * np.uint64(count)) >> U32)


@compiled
def lower_integer(bits, count):
    """Return the integer from 0 to below ``count`` that the lower half of 64 bits stands for."""
    return np.int64(((bits & LOWER_HALF) * np.uint64(count)) >> U32)

"""Chance that is counted: the k-th number of a stream depends on its key and on k alone.

Streams are SplitMix64 (Steele, Lea & Flood 2014): a counter, mixed. A state is an array of one unsigned integer.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled

STEP = np.uint64(0x9E3779B97F4A7C15)
FIRST, SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
U11, U27, U30, U31, U32 = np.uint64(11), np.uint64(27), np.uint64(30), np.uint64(31), np.uint64(32)
LOWER_HALF = np.uint64(0xFFFFFFFF)
UNIT = 2.0**-53


@compiled
def mixed(z):
    """Return a number's bits, mixed."""
    z = (z ^ (z >> U30)) * FIRST
    z = (z ^ (z >> U27)) * SECOND
    return z ^ (z >> U31)


@compiled
def begin(state, seed, step):
    """Set a state to the beginning of the stream of a seed and a step."""
    state[0] = mixed(mixed(np.uint64(seed) + STEP) ^ (np.uint64(step) * STEP))


@compiled
def bits(state):
    """Return the next 64 bits."""
    state[0] += STEP
    return mixed(state[0])


@compiled
def share(state):
    """Return the next number from 0 to below 1."""
    return np.float64(bits(state) >> U11) * UNIT


@compiled
def upper(drawn, count):
    """Return a number from 0 to below ``count`` that the upper half of some bits stands for."""
    return np.int64(((drawn >> U32) * np.uint64(count)) >> U32)


@compiled
def lower(drawn, count):
    """Return a number from 0 to below ``count`` that the lower half of some bits stands for."""
    return np.int64(((drawn & LOWER_HALF) * np.uint64(count)) >> U32)

"""Batches of samples run through a kernel in blocks that stay in the cache."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.robot.arm import Arm
from paretoik.robot.components import Component

BLOCK_SIZE = 6144  # samples: enough to drown the cost of a call; at 48 KB a column, memory is reused, not mapped anew


def evaluate_in_blocks(
    kernel: Callable[..., Sequence[Component]], arm: Arm, shape: tuple[int, ...], *arrays: np.ndarray
) -> np.ndarray:
    """Run ``kernel(*columns)`` over samples (*batch, dof), a block at a time; return (*batch, *shape).

    Each argument reaches the kernel as a list of dof contiguous columns; the kernel returns the entries of ``shape`` in
    order. Raises InvalidInput where an array's last axis is not the arm's dof or the batches differ.
    """
    arrays = tuple(np.asarray(array) for array in arrays)
    for array in arrays:
        if array.ndim == 0 or array.shape[-1] != arm.dof:
            raise InvalidInput(f"{arm.name} has {arm.dof} joints; got an array of shape {array.shape}")
        if array.shape != arrays[0].shape:
            raise InvalidInput(f"joint arrays must have one shape, got {arrays[0].shape} and {array.shape}")
    batch = arrays[0].shape[:-1]
    count = int(np.prod(batch))
    flat = [array.reshape(count, arm.dof) for array in arrays]
    entries = int(np.prod(shape))
    out = np.empty((count, entries), dtype=np.result_type(float, *arrays))
    for start in range(0, count, BLOCK_SIZE):
        stop = min(start + BLOCK_SIZE, count)
        block = [[np.ascontiguousarray(part[start:stop, joint]) for joint in range(arm.dof)] for part in flat]
        for entry, value in enumerate(kernel(*block)):
            out[start:stop, entry] = value
    return out.reshape(*batch, *shape)

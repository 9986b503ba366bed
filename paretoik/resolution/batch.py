"""Starts and the numbers of a method as one flat batch: a motion for each combination that broadcasting makes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.errors import InvalidInput
from paretoik.resolution.methods import Criterion, VelocityMethod
from paretoik.robot.arm import Arm

SETTINGS = "region", "damping", "buffer", "repulsion", "band"  # columns after the feedback; 0 where a method has none


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """Motions of shape ``shape``, flat: their starts, and the numbers that they are followed with.

    ``settings`` are feedback, then ``SETTINGS``; ``gains`` the gain and the rank of every criterion, 0 the first.
    """

    shape: tuple[int, ...]
    start: Float[np.ndarray, "motions dof"]
    settings: Float[np.ndarray, "motions columns"]
    gains: Float[np.ndarray, "motions criteria 2"]


def broadcast(
    method: VelocityMethod,
    criteria: Sequence[Criterion],
    start: Float[np.ndarray, "*starts dof"],
    steps: Float[np.ndarray, " steps"],
) -> Batch:
    """Return one motion for each start and set of numbers; raise InvalidInput where they do not fit each other."""
    name, highest = type(method).__name__, 1.0 / float(steps.max())
    feedback = np.asarray(highest if method.feedback is None else method.feedback, dtype=float)
    if not ((feedback >= 0) & (feedback <= highest * (1 + 1e-12))).all():
        raise InvalidInput(
            f"{name}: feedback from 0 to {highest:.4g} 1/s wanted, one over the longest step, got {method.feedback}"
        )
    numbers = [feedback] + [np.asarray(getattr(method, each, 0.0), dtype=float) for each in SETTINGS]
    numbers += [np.asarray(each.gain, dtype=float) for each in criteria]
    priorities = getattr(method, "priorities", None)
    ranks = np.arange(len(criteria)) if priorities is None else np.argsort(np.argsort(priorities, axis=-1), axis=-1)
    if ranks.shape[-1:] != (len(criteria),):
        raise InvalidInput(f"{name}: priorities for each of {len(criteria)} criteria wanted, got shape {ranks.shape}")
    try:
        shape = np.broadcast_shapes(start.shape[:-1], ranks.shape[:-1], *(each.shape for each in numbers))
    except ValueError:
        shapes = sorted({str(one) for one in (ranks.shape[:-1], *(each.shape for each in numbers)) if one})
        raise InvalidInput(
            f"{name}: starts of shape {start.shape[:-1]} and numbers of {', '.join(shapes)} do not fit each other"
        ) from None
    if 0 in shape:
        raise InvalidInput(f"{name}: numbers wanted, got an empty array")

    def flat(values: np.ndarray, *axes: int) -> np.ndarray:
        return np.broadcast_to(values, (*shape, *axes)).reshape(int(np.prod(shape)), *axes)

    columns = np.stack([flat(each) for each in numbers], axis=1)
    count = 1 + len(SETTINGS)
    return Batch(
        shape=shape,
        start=flat(start, start.shape[-1]),
        settings=np.ascontiguousarray(columns[:, :count]),
        gains=np.stack([columns[:, count:], flat(ranks, len(criteria)).astype(float)], axis=2),
    )


def position_ranges(arm: Arm, limits: Float[np.ndarray, "*times dof 2"]) -> Float[np.ndarray, "*times dof"]:
    """Return the ranges [rad, m] of joints between their position limits.

    A joint with one limit alone counts as having a range of a whole turn or 1 m; it is inf with none.
    """
    span = limits[..., 1] - limits[..., 0]
    one = np.isfinite(limits).any(axis=-1) & np.isinf(span)
    return np.where(one, np.where(arm.periodic, 2 * np.pi, 1.0), span)


@cache
def compiled_kernels() -> Any:
    """Return the compiled kernels."""
    from paretoik.resolution import kernels  # here: numba takes its time

    return kernels

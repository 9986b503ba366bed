"""Starts and the numbers of a method as lanes: one motion for each combination that broadcasting makes."""

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
class Lanes:
    """Motions of shape ``batch``, flat: where they start, and the numbers that they are followed with.

    ``settings`` (lanes, 6) are feedback, then ``SETTINGS``; ``gains`` (lanes, criteria, 2) gain and rank, 0 the first.
    """

    batch: tuple[int, ...]
    start: Float[np.ndarray, "lanes dof"]
    settings: Float[np.ndarray, "lanes columns"]
    gains: Float[np.ndarray, "lanes criteria 2"]


def lanes(
    method: VelocityMethod,
    criteria: Sequence[Criterion],
    start: Float[np.ndarray, "*starts dof"],
    steps: Float[np.ndarray, " steps"],
) -> Lanes:
    """Return one lane for each start and set of numbers; raise InvalidInput where they do not fit each other."""
    name, most = type(method).__name__, 1.0 / float(steps.max())
    feedback = np.asarray(most if method.feedback is None else method.feedback, dtype=float)
    if not ((feedback >= 0) & (feedback <= most * (1 + 1e-12))).all():
        raise InvalidInput(
            f"{name}: feedback from 0 to {most:.4g} 1/s wanted, one over the longest step, got {method.feedback}"
        )
    numbers = [feedback] + [np.asarray(getattr(method, each, 0.0), dtype=float) for each in SETTINGS]
    numbers += [np.asarray(each.gain, dtype=float) for each in criteria]
    given = getattr(method, "priorities", None)
    ranks = np.arange(len(criteria)) if given is None else np.argsort(np.argsort(given, axis=-1), axis=-1)
    if ranks.shape[-1:] != (len(criteria),):
        raise InvalidInput(f"{name}: priorities for each of {len(criteria)} criteria wanted, got shape {ranks.shape}")
    try:
        batch = np.broadcast_shapes(start.shape[:-1], ranks.shape[:-1], *(each.shape for each in numbers))
    except ValueError:
        shapes = sorted({str(shape) for shape in (ranks.shape[:-1], *(each.shape for each in numbers)) if shape})
        raise InvalidInput(
            f"{name}: starts of shape {start.shape[:-1]} and numbers of {', '.join(shapes)} do not fit each other"
        ) from None
    if 0 in batch:
        raise InvalidInput(f"{name}: numbers wanted, got an empty array")

    def flat(values: np.ndarray, *axes: int) -> np.ndarray:
        return np.broadcast_to(values, (*batch, *axes)).reshape(int(np.prod(batch)), *axes)

    columns = np.stack([flat(each) for each in numbers], axis=1)
    own = 1 + len(SETTINGS)
    return Lanes(
        batch=batch,
        start=flat(start, start.shape[-1]),
        settings=np.ascontiguousarray(columns[:, :own]),
        gains=np.stack([columns[:, own:], flat(ranks, len(criteria)).astype(float)], axis=2),
    )


def ranges(arm: Arm, limits: Float[np.ndarray, "*times dof 2"]) -> Float[np.ndarray, "*times dof"]:
    """Return how far [rad, m] joints may go between their position limits.

    With one limit alone that counts as a whole turn or 1 m; it is inf with none.
    """
    between = limits[..., 1] - limits[..., 0]
    one = np.isfinite(limits).any(axis=-1) & np.isinf(between)
    return np.where(one, np.where(arm.periodic, 2 * np.pi, 1.0), between)


@cache
def engine() -> Any:
    """Return what runs lanes, compiled once, then cached."""
    from paretoik.resolution import kernels as following  # here: numba takes its time

    return following

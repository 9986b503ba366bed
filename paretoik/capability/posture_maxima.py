"""How fast a tool can go in one posture: along a direction, the nearest facet of the zonotope of its velocities.

Joints turn between their lowest and highest speed, each by itself, so that tool velocities J q̇ are a zonotope. The
normal of a facet is orthogonal to as many columns of J as span it: one in the plane, two in space. The axes, as columns
of joints that do not move, close the gaps where columns are parallel. Source: Kim, Shin & Jang 2021 (allowable
polygons); Ziegler, Lectures on Polytopes, section 7.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from paretoik.nlp.linear_program import furthest


@dataclass(frozen=True, kw_only=True)
class FacetOptions:
    """When columns count as orthogonal to the normal of a facet, and when a normal bounds a direction.

    ``orthogonal`` is the cosine of a column with a normal, and the share of a range or speed, below which there is
    none. A normal that has less of a direction than ``crossing``, a share of its length, does not bound it.
    """

    orthogonal: float = 1e-9
    crossing: float = 1e-14


OPTIONS = FacetOptions()


def normals(columns: Float[np.ndarray, "*batch task dof"]) -> Float[np.ndarray, "*batch normals task"]:
    """Return the normals that facets can have, not of length 1, some of them 0."""
    task = columns.shape[-2]
    axes = np.broadcast_to(np.eye(task), (*columns.shape[:-2], task, task))
    every = np.concatenate([columns, axes], axis=-1)
    if task == 2:
        return np.stack([-every[..., 1, :], every[..., 0, :]], axis=-1)
    pairs = np.array(list(combinations(range(every.shape[-1]), 2)))
    return np.cross(every[..., pairs[:, 0]], every[..., pairs[:, 1]], axis=-2).swapaxes(-1, -2)


def highest_speeds(
    columns: Float[np.ndarray, "*batch task dof"],
    low: Float[np.ndarray, "*batch dof"],
    high: Float[np.ndarray, "*batch dof"],
    directions: Float[np.ndarray, "*#batch directions task"],
) -> Float[np.ndarray, "*batch directions"]:
    """Return the highest speed along each direction [m/s]; NaN in postures where a joint's speeds are NaN.

    ``columns`` is the Jacobian of positions, and low ≤ 0 ≤ high.
    """
    _, bound, nearest = _facets(columns, low, high, directions)
    return _where_known(low, high, np.take_along_axis(bound, nearest[..., None, :], axis=-2)[..., 0, :])


def greatest_forces(
    columns: Float[np.ndarray, "*batch task dof"],
    low: Float[np.ndarray, "*batch dof"],
    high: Float[np.ndarray, "*batch dof"],
    directions: Float[np.ndarray, "*#batch directions task"],
) -> Float[np.ndarray, "*batch directions"]:
    """Return the greatest force along each direction [N] with low ≤ Jᵀ f ≤ high; inf where no joint has to bear it.

    Torques are to forces as tool velocities are to joint speeds, by the same Jacobian transposed (virtual work).
    """
    shares = directions @ columns
    with np.errstate(divide="ignore", invalid="ignore"):
        bound = np.where(shares > 0, high[..., None, :], low[..., None, :]) / shares
    return _where_known(low, high, np.where(shares != 0, bound, np.inf).min(axis=-1))


def _where_known(low: np.ndarray, high: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values (*batch, directions), NaN in postures where a joint's range is NaN."""
    return np.where((np.isnan(low) | np.isnan(high)).any(axis=-1)[..., None], np.nan, values)


def fastest_joint_speeds(
    columns: Float[np.ndarray, "batch task dof"],
    low: Float[np.ndarray, "batch dof"],
    high: Float[np.ndarray, "batch dof"],
    directions: Float[np.ndarray, "batch task"],
) -> tuple[Float[np.ndarray, " batch"], Float[np.ndarray, "batch dof"]]:
    """Return ``highest_speeds``, one direction a posture, and joint speeds within their ranges that reach them.

    On a facet all joints but those whose columns span it are at one of their ends; these follow from the velocity.
    """
    faces, bound, index = _facets(columns, low, high, directions[:, None])
    rows = np.arange(len(faces))
    speeds = _where_known(low, high, bound[rows, index[:, 0]])[:, 0]
    vertices = directions * speeds[:, None]
    nearest = faces[rows, index[:, 0]]
    nearest = nearest * np.where((nearest * vertices).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    shares = np.einsum("ba,baj->bj", nearest, columns)
    size = np.linalg.norm(nearest, axis=1)[:, None] * np.linalg.norm(columns, axis=1)
    between = np.abs(shares) <= OPTIONS.orthogonal * size
    ends = np.where(between, 0.0, np.where(shares > 0, high, low))
    remainder = vertices - np.einsum("baj,bj->ba", columns, ends)
    dq = ends + np.einsum("bja,ba->bj", np.linalg.pinv(columns * between[:, None]), remainder)
    tolerance = OPTIONS.orthogonal * (high - low)
    missed = np.abs(np.einsum("baj,bj->ba", columns, dq) - vertices).max(axis=1)
    wrong = ((dq < low - tolerance) | (dq > high + tolerance)).any(axis=1)
    for row in np.flatnonzero(wrong | (missed > OPTIONS.orthogonal * np.linalg.norm(vertices, axis=1))):
        length = float(np.linalg.norm(vertices[row])) or 1.0
        _, dq[row] = furthest(columns[row], low[row], high[row], vertices[row] / length)
    return speeds, np.clip(dq, low, high)


def _facets(
    columns: np.ndarray, low: np.ndarray, high: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the normals, how far each lets one go (*batch, normals, directions), and which does least.

    The rounding of a normal that is nearly orthogonal to a direction counts against it: it must not do least.
    """
    faces = normals(columns)
    shares = faces @ columns
    one, other = shares * low[..., None, :], shares * high[..., None, :]
    ahead, behind = np.maximum(one, other).sum(axis=-1), -np.minimum(one, other).sum(axis=-1)
    along = faces @ np.swapaxes(directions, -1, -2)
    length = np.linalg.norm(faces, axis=-1)
    reach = np.sum(np.linalg.norm(columns, axis=-2) * np.maximum(-low, high), axis=-1)
    size = length[..., None] * np.linalg.norm(directions, axis=-1)[..., None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        bound = np.where(along > 0, ahead[..., None], behind[..., None]) / np.abs(along)
        rounding = 8 * np.finfo(float).eps * (length * reach[..., None])[..., None] / np.abs(along)
    crosses = np.abs(along) > OPTIONS.crossing * size
    nearest = np.where(crosses, bound + rounding, np.inf).argmin(axis=-2)
    return faces, np.where(crosses, bound, np.inf), nearest
